import { render } from "preact";
import { useState } from "preact/hooks";
import { showAsChosen } from "./display";
import { t } from "./i18n";
import { listenToKeys } from "./keys";
import { Bus } from "./pages/bus";
import { Jobs } from "./pages/jobs";
import { Machine } from "./pages/machine";
import { Operate } from "./pages/operate";
import { Programs } from "./pages/programs";
import { Setup } from "./pages/setup";
import { Signals } from "./pages/signals";
import { Prompt } from "./prompt";
import { PAGES, type Page, usePage } from "./route";
import { Actions, Banners, StateBar, Toasts, TokenDialogue, ToolDialogue } from "./shell";
import { connect, useStore } from "./store";
import { Icon } from "./ui";

const VIEWS: Partial<Record<Page, () => preact.JSX.Element>> = {
  operate: Operate,
  setup: Setup,
  programs: Programs,
  jobs: Jobs,
  signals: Signals,
  bus: Bus,
  machine: Machine,
};

function App() {
  const page = usePage();
  const [menu, setMenu] = useState(false);
  // Pages ask as they come up: not before there is somebody to ask.
  const known = useStore((s) => s.status !== null);
  const View = VIEWS[page] ?? Operate;
  return (
    <div class="app">
      <StateBar />
      <nav class={menu ? "rail open" : "rail"} aria-label={t("pages")}>
        {PAGES.filter((one) => VIEWS[one]).map((one) => (
          <a key={one} href={`#/${one}`} data-testid={`page-${one}`} aria-current={one === page ? "page" : undefined} onClick={() => setMenu(false)}>
            <Icon name={one} />
            <span>{t(`page-${one}`)}</span>
          </a>
        ))}
      </nav>
      <main>
        <Banners />
        {known ? <View /> : <p class="muted">{t("connecting")}</p>}
      </main>
      <div class="foot">
        <Prompt />
        <Actions />
        <Toasts />
      </div>
      <ToolDialogue />
      <TokenDialogue />
    </div>
  );
}

showAsChosen();
listenToKeys();
connect();
render(<App />, document.getElementById("app")!);
