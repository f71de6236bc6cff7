/** Dialogues in which something is changed: a number, or by a line of MDI that is shown first. */
import { useState } from "preact/hooks";
import { fixed, parseNumber, t } from "../i18n";
import { order } from "../store";
import { Button, Dialog, Field, Form } from "../ui";

/** Where a number is changed: which, and what it is now. */
export interface Edited {
  title: string;
  value: string;
  /** What else the change does. */
  note?: string;
  set: (value: number) => Promise<unknown>;
}

export function Edit({ edited, onClose }: { edited: Edited; onClose: () => void }) {
  const [text, setText] = useState(edited.value);
  const value = parseNumber(text);
  const set = () => void edited.set(value).then((answer) => answer !== undefined && onClose());
  return (
    <Dialog id="edit-dialogue" title={edited.title} onClose={onClose}>
      <Form onSend={set}>
        <Field numeric label={t("value")} value={text} onInput={setText} id="edit-value" />
        <p class="preview">
          {Number.isNaN(value) ? (
            t("no-number")
          ) : (
            <>
              {edited.value} → <b>{fixed(value, 4)}</b>
            </>
          )}
        </p>
        {edited.note && <p class="muted">{edited.note}</p>}
        <footer>
          <Button id="edit-set" kind="go" label={t("set")} orders="offset set, tool set" disabled={Number.isNaN(value)} submit />
        </footer>
      </Form>
    </Dialog>
  );
}

/** A line of MDI: what for, and the line. */
export interface Typed {
  title: string;
  text: string;
  line: string;
}

/** Shows a line, and runs it once someone has said so. */
export function RunLine({ typed, onClose }: { typed: Typed; onClose: () => void }) {
  return (
    <Dialog id="line-dialogue" title={typed.title} onClose={onClose}>
      <p>{typed.text}</p>
      <code data-testid="line">{typed.line}</code>
      <footer>
        <Button id="line-run" kind="go tall" icon="start" label={t("run")} orders="mdi" onClick={() => void order("mdi", { line: typed.line }).then((answer) => answer !== undefined && onClose())} />
      </footer>
    </Dialog>
  );
}
