/** The machine file: read, changed with a check at each pause of typing, put in its place for the next start. */
import { useEffect, useRef, useState } from "preact/hooks";
import { t } from "../i18n";
import { ask, connection, order, say, tellRefused, useStatus, useStore } from "../store";
import type { FileError, MachineFile } from "../types";
import { Button, Card } from "../ui";

/** Typing rests for so long before the text is checked. */
const PAUSE_MS = 400;
/** States in which the file may be changed. */
const RESTS: readonly string[] = ["booting", "disabled", "ready", "faulted", "estop"];

export function FileEditor() {
  const [file, setFile] = useState<MachineFile | null>(null);
  const [text, setText] = useState("");
  const [errors, setErrors] = useState<FileError[] | null>(null);
  const [failed, setFailed] = useState("");
  const area = useRef<HTMLTextAreaElement>(null);
  const numbers = useRef<HTMLPreElement>(null);
  const may = useStore((s) => s.role === "set-up");
  const rests = RESTS.includes(useStatus((s) => s.state) ?? "");
  const changed = file !== null && text !== file.text;

  const read = () =>
    ask("machine.file").then(
      (answer) => {
        setFile(answer);
        setText(answer.text);
        setErrors(answer.errors);
        setFailed("");
      },
      (refused: Error) => setFailed(refused.message),
    );
  const connected = useStore((s) => s.connected);
  // What is being typed is not lost with the connection.
  useEffect(() => void (connected && !changed && read()), [connected]);

  useEffect(() => {
    if (!changed || !may) return;
    setErrors(null);
    let wanted = true;
    const timer = setTimeout(() => {
      connection.call("machine.check", { text }).then(({ errors }) => wanted && setErrors(errors), tellRefused);
    }, PAUSE_MS);
    return () => {
      wanted = false;
      clearTimeout(timer);
    };
  }, [text, changed, may]);

  const write = async () => {
    const answer = await order("machine.write", { text, sha256: file!.sha256 });
    if (!answer) return;
    setFile({ ...file!, text, sha256: answer.sha256 });
    say("note", t("file-written", { before: answer.before }));
  };

  const goTo = ({ line, column }: FileError) => {
    const element = area.current;
    if (!element || line === null) return;
    const before = text.split("\n").slice(0, line - 1).join("\n");
    const at = before.length + (line > 1 ? 1 : 0) + Math.max(0, (column ?? 1) - 1);
    element.focus();
    element.setSelectionRange(at, at);
    element.scrollTop = Math.max(0, (line - 4) * (element.scrollHeight / text.split("\n").length));
  };

  const lines = text.split("\n").length;
  const wrong = new Set(errors?.map(({ line }) => line));
  return (
    <Card title={t("machine-file")} kind="file">
      {failed && <p class="strong">{failed}</p>}
      <p class="muted">
        {file?.file} · {t("file-explained")} {!may && t("file-role")}
      </p>
      <div class="editor">
        <pre ref={numbers} aria-hidden="true">
          {Array.from({ length: lines }, (_, at) => (
            <div key={at} class={wrong.has(at + 1) ? "wrong" : undefined}>
              {at + 1}
            </div>
          ))}
        </pre>
        <textarea
          ref={area}
          data-testid="machine-file"
          aria-label={t("machine-file")}
          spellcheck={false}
          autocomplete="off"
          wrap="off"
          readOnly={!may}
          value={text}
          onInput={(event) => setText(event.currentTarget.value)}
          onScroll={(event) => numbers.current && (numbers.current.scrollTop = event.currentTarget.scrollTop)}
        />
      </div>
      <div class="file-foot">
        <div class="file-errors" role="status" data-testid="file-errors" data-count={errors?.length ?? ""}>
          {errors === null && changed && t("checking")}
          {errors?.length === 0 && t("file-right")}
          <ul>
            {errors?.map((error, at) => (
              <li key={at}>
                <button type="button" onClick={() => goTo(error)}>
                  {error.line !== null && <b>{error.line}</b>} <code>{error.key}</code> {error.rule} {error.hint && <small>{error.hint}</small>}
                </button>
              </li>
            ))}
          </ul>
        </div>
        <div class="row">
          <Button id="file-write" kind="warn" label={t("file-write")} disabled={!changed || errors === null || errors.length > 0 || !may || !rests} onClick={() => void write()} />
          <Button label={t("file-again")} disabled={!changed} onClick={() => void read()} />
          {changed && !rests && <span class="muted">{t("file-rest")}</span>}
        </div>
      </div>
    </Card>
  );
}
