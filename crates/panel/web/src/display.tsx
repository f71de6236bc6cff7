/** How it is shown: dark or light, English or German. */
import { language, setLanguage, t } from "./i18n";
import { Button } from "./ui";

export function Display() {
  return (
    <>
      <Button
        icon="theme"
        kind="chip icon-only"
        id="theme"
        title={t("theme")}
        onClick={() => {
          const next = chosenTheme() === "dark" ? "light" : "dark";
          localStorage.setItem("theme", next);
          document.documentElement.dataset.theme = next;
        }}
      >
        <span class="hidden">{t("theme")}</span>
      </Button>
      <Button kind="chip" id="language" onClick={() => setLanguage(language === "en" ? "de" : "en")}>
        <span lang={language === "en" ? "de" : "en"}>{language === "en" ? "DE" : "EN"}</span>
        <span class="hidden">{t("language")}</span>
      </Button>
    </>
  );
}

/** What was chosen here, else what the device wants. */
function chosenTheme(): string {
  return localStorage.getItem("theme") ?? (matchMedia("(prefers-color-scheme: light)").matches ? "light" : "dark");
}

/** Before anything is drawn. */
export function showAsChosen(): void {
  document.documentElement.lang = language;
  document.documentElement.dataset.theme = chosenTheme();
}
