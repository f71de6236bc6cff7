/** What the steps are made of. */
import type { ComponentChildren } from "preact";
import { Icon } from "../ui";

export function Step({ number, title, done, children }: { number: number; title: string; done: boolean; children: ComponentChildren }) {
  return (
    <section class={done ? "card step done" : "card step"} aria-label={title} data-testid={`step-${number}`}>
      <header>
        <span class="badge" aria-hidden="true">
          {done ? <Icon name="check" /> : number}
        </span>
        <h2>{title}</h2>
      </header>
      {children}
    </section>
  );
}

/** Why something did not work, in words. */
export function Failed({ id, text }: { id: string; text: string }) {
  return (
    <p class="failed" role="alert" data-testid={id}>
      <Icon name="warning" />
      <span>{text}</span>
    </p>
  );
}

/** A word of warning, or that all is well. */
export function Note({ kind, children }: { kind: "good" | "wait"; children: ComponentChildren }) {
  return (
    <p class={`note ${kind}`}>
      <Icon name={kind === "good" ? "check" : "warning"} />
      <span>{children}</span>
    </p>
  );
}

export interface Option {
  value: string;
  label: string;
  /** What it means. */
  text?: string;
  /** It does not suit. */
  unfit?: boolean;
}

/** A question of which one answer is chosen. */
export function Pick({ id, label, value, options, onChange }: { id: string; label: string; value: string; options: Option[]; onChange: (value: string) => void }) {
  return (
    <fieldset>
      <legend>{label}</legend>
      <div class="picks">
        {options.map((option) => (
          <label key={option.value} class={option.value === value ? "pick chosen" : "pick"}>
            <input type="radio" name={id} data-testid={`${id}-${option.value}`} checked={option.value === value} onChange={() => onChange(option.value)} />
            <span>
              <b>{option.label}</b>
              {option.text && (
                <small class={option.unfit ? "unfit" : undefined}>
                  {option.unfit && <Icon name="warning" />}
                  {option.text}
                </small>
              )}
            </span>
          </label>
        ))}
      </div>
    </fieldset>
  );
}

/** The panel, at the page with the jog buttons. Its address may be that of this page: only loaded anew it is another one. */
export function leave(): void {
  history.replaceState(null, "", "./#/setup");
  location.reload();
}
