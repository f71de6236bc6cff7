/** From a bare PC to a machine file, and to a control that runs it: the page of `isocnc init --panel`. */
import { render } from "preact";
import { useEffect, useState } from "preact/hooks";
import { Display, showAsChosen } from "../display";
import { t } from "../i18n";
import { logIn, token } from "../store";
import { Button, Card, Field, Form } from "../ui";
import { type Answers, LOG_IN, NONE, type Offer, begin, statusOf, why } from "./contract";
import { type Kept, answersOf, fresh, keep, kept, nodesOf } from "./answers";
import { Failed, leave } from "./parts";
import { AxesStep, BusStep, FileStep, MachineStep, StartStep } from "./steps";
import "./init.css";

function App() {
  const [offer, setOffer] = useState<Offer | null>(null);
  const [failed, setFailed] = useState<{ status: number | undefined; text: string } | null>(null);
  const look = () =>
    begin().then(
      (found) => {
        setOffer(found);
        setFailed(null);
      },
      (error) => (statusOf(error) === NONE ? leave() : setFailed({ status: statusOf(error), text: why(error) })),
    );
  useEffect(() => void look(), []);
  return (
    <div class="init">
      <header>
        <span class="logo" aria-hidden="true" />
        <b>isocnc init</b>
        <Display />
      </header>
      <main>
        <h1>{t("init-title")}</h1>
        {offer && <p class="muted">{t("init-intro", { file: offer.file })}</p>}
        {!offer && !failed && <p class="muted">{t("init-looking")}</p>}
        {failed &&
          (failed.status === LOG_IN ? (
            <LogIn />
          ) : (
            <Card kind="step">
              <Failed id="init-failed" text={failed.text} />
              <Button id="init-again" icon="reset" label={t("init-again")} onClick={() => void look()} />
            </Card>
          ))}
        {offer && <Steps offer={offer} look={look} />}
      </main>
    </div>
  );
}

function Steps({ offer, look }: { offer: Offer; look: () => Promise<void> }) {
  const [all, setAll] = useState<Kept>(() => kept(offer) ?? { file: offer.file, typed: fresh(offer), scan: null, written: null });
  // What is the same once more is checked once more: the other end may know another scan.
  const [turn, setTurn] = useState(0);
  const { typed, scan, written } = all;
  useEffect(() => keep(all), [all]);
  const change = (next: Partial<Kept>) => setAll((now) => ({ ...now, ...next }));
  const type = (next: Partial<Kept["typed"]>) => setAll((now) => ({ ...now, typed: { ...now.typed, ...next } }));
  const nodes = nodesOf(typed, scan);
  const answers: Answers | null = answersOf(typed, nodes, offer.cycle_us);
  return (
    <>
      <MachineStep offer={offer} typed={typed} type={type} />
      <BusStep
        offer={offer}
        typed={typed}
        type={type}
        scan={scan}
        onScan={(scan) => {
          change({ scan });
          setTurn(turn + 1);
        }}
        look={look}
        done={nodes !== null}
      />
      <AxesStep typed={typed} type={type} nodes={nodes} done={answers !== null} />
      <FileStep offer={offer} answers={answers} turn={turn} again={() => setTurn(turn + 1)} written={written} onWritten={(written) => change({ written })} ready={nodes !== null} />
      <StartStep file={written?.file ?? null} done={written !== null && written.answers === JSON.stringify(answers)} />
    </>
  );
}

/** From another PC. */
function LogIn() {
  const [text, setText] = useState("");
  const wanted = text.trim();
  return (
    <Card kind="step" title={t("token-dialogue")}>
      <Form onSend={() => logIn(wanted)}>
        <p>{t(token ? "token-wrong" : "token-missing")}</p>
        <p class="muted">{t("init-token")}</p>
        <Field id="token" label={t("token")} value={text} onInput={setText} />
        <Button id="log-in" kind="go" label={t("log-in")} disabled={!wanted} submit />
      </Form>
    </Card>
  );
}

showAsChosen();
render(<App />, document.getElementById("app")!);
