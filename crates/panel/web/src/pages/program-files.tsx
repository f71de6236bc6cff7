/** Programs into the control, and the list of those that it keeps. */
import { useMemo, useRef, useState } from "preact/hooks";
import { EXISTS, type Folder, type StoredFile, addressOf, deleteFile, downloadFile, listFiles, putFile, renameFile } from "../files";
import { HttpRefused } from "../http";
import { dateAndTime, fixed, language, t } from "../i18n";
import { send, tellLoaded } from "../send";
import { isBlind, order, say, tellRefused, token, useStatus } from "../store";
import { Button, Choice, Dialog, Field, Form } from "../ui";

/** Files that are shown at once. */
const SHOWN_MAX = 200;
/** From so many files on there is a search. */
const SEARCH_FROM = 10;

function size(octets: number): string {
  if (octets < 1e3) return `${octets} B`;
  return octets < 1e6 ? `${fixed(octets / 1e3, 1)} kB` : `${fixed(octets / 1e6, 1)} MB`;
}

async function load(name: string): Promise<void> {
  const outlook = await order("program.load", { file: name });
  if (outlook) tellLoaded(outlook);
}

/** A file whose name is in the folder already, and who waits for what is to become of it. */
interface Question {
  file: File;
  existing: StoredFile;
  answer: (replace: boolean) => void;
}

export function Upload({ folder: { files, refresh } }: { folder: Folder }) {
  const input = useRef<HTMLInputElement>(null);
  const stop = useRef<AbortController | null>(null);
  const [progress, setProgress] = useState<{ name: string; share: number } | null>(null);
  const [over, setOver] = useState(false);
  const [question, setQuestion] = useState<Question | null>(null);
  const [refused, setRefused] = useState<{ name: string; why: string }[]>([]);
  const keeps = files !== null;

  const isToBeReplaced = async (file: File, existing: StoredFile): Promise<boolean> => {
    const replace = await new Promise<boolean>((answer) => setQuestion({ file, existing, answer }));
    setQuestion(null);
    return replace;
  };

  /** Whether it is in the folder now. */
  const keep = async (file: File, known: StoredFile[], signal: AbortSignal): Promise<boolean> => {
    let existing = known.find(({ name }) => name === file.name);
    for (;;) {
      if (existing && !(await isToBeReplaced(file, existing))) return false;
      try {
        await putFile(file, existing !== undefined, (share) => setProgress({ name: file.name, share }), signal);
        return true;
      } catch (error) {
        // It has come meanwhile, by another way.
        if (!(error instanceof HttpRefused) || error.status !== EXISTS || existing) throw error;
        existing = (await listFiles()).find(({ name }) => name === file.name);
      }
    }
  };

  const keepAll = async (wanted: File[]): Promise<void> => {
    const ending = new AbortController();
    stop.current = ending;
    const kept: string[] = [];
    const not: { name: string; why: string }[] = [];
    try {
      const known = await listFiles();
      for (const file of wanted) {
        if (ending.signal.aborted) break;
        setProgress({ name: file.name, share: 0 });
        await keep(file, known, ending.signal).then(
          (is) => is && kept.push(file.name),
          (error: Error) => not.push({ name: file.name, why: error.message }),
        );
      }
    } catch (error) {
      not.push({ name: wanted[0]!.name, why: (error as Error).message });
    }
    setProgress(null);
    setRefused(not);
    await refresh();
    // Of several, which one is meant is not known.
    if (wanted.length === 1 && kept.length === 1) await load(kept[0]!);
    else if (kept.length > 0) say("note", t(kept.length === 1 ? "file-kept" : "files-kept", { n: kept.length }));
  };

  const take = async (list: FileList | null | undefined) => {
    const wanted = [...(list ?? [])];
    if (wanted.length === 0 || progress) return;
    if (isBlind()) return say("refused", t("not-sent"));
    setRefused([]);
    if (keeps) return keepAll(wanted);
    setProgress({ name: wanted[0]!.name, share: 0 });
    await send(wanted[0]!, (share) => setProgress({ name: wanted[0]!.name, share })).catch(tellRefused);
    setProgress(null);
  };

  return (
    <div
      class={over ? "drop over" : "drop"}
      data-testid="drop"
      onDragOver={(event) => {
        event.preventDefault();
        setOver(true);
      }}
      onDragLeave={() => setOver(false)}
      onDrop={(event) => {
        event.preventDefault();
        setOver(false);
        void take(event.dataTransfer?.files);
      }}
    >
      <input
        ref={input}
        type="file"
        class="hidden"
        data-testid="upload"
        aria-label={t("upload")}
        tabIndex={-1}
        multiple={keeps}
        onChange={(event) => {
          void take(event.currentTarget.files);
          event.currentTarget.value = "";
        }}
      />
      {progress ? (
        <div class="uploading" role="status" data-testid="uploading">
          <progress value={progress.share} aria-label={progress.name} />
          <span>
            {progress.name} · {Math.round(100 * progress.share)} %
          </span>
          {keeps && <Button id="upload-cancel" icon="close" label={t("upload-cancel")} onClick={() => stop.current?.abort()} />}
        </div>
      ) : (
        <Button id="upload-button" kind="go tall" icon="upload" orders="program load" label={t("upload")} onClick={() => input.current?.click()} />
      )}
      <p class="muted">{t(keeps ? "upload-keep" : "upload-drag")}</p>
      {refused.length > 0 && (
        <ul class="not-kept" role="alert" data-testid="not-kept">
          {refused.map(({ name, why }) => (
            <li key={name}>
              <b>{t("file-not-kept", { name })}</b>
              <pre tabIndex={0} aria-label={name}>
                {why}
              </pre>
            </li>
          ))}
        </ul>
      )}
      {question && <Replace {...question} />}
    </div>
  );
}

function Replace({ file, existing, answer }: Question) {
  const loaded = useStatus((s) => isLoaded(s.program?.name, existing.name));
  return (
    <Dialog id="replace-dialogue" title={t("file-replace", { name: file.name })} onClose={() => answer(false)}>
      <table class="figures">
        <tbody>
          <tr>
            <th scope="row">{t("file-existing")}</th>
            <td>{size(existing.octets)}</td>
            <td>{dateAndTime(existing.modified_unix_s)}</td>
          </tr>
          <tr>
            <th scope="row">{t("file-yours")}</th>
            <td>{size(file.size)}</td>
            <td>{dateAndTime(file.lastModified / 1000)}</td>
          </tr>
        </tbody>
      </table>
      {loaded && <p>{t("file-copy")}</p>}
      <footer>
        <Button id="replace-no" label={t("file-replace-no")} onClick={() => answer(false)} />
        <Button id="replace-yes" kind="warn" label={t("file-replace-yes")} orders="program load" onClick={() => answer(true)} />
      </footer>
    </Dialog>
  );
}

/** Whether the program of the status comes from this file, as it is or as it was. */
const isLoaded = (program: string | undefined, name: string): boolean => program === name || (program?.endsWith(`/${name}`) ?? false);

type Sort = "name" | "time";

const byName = new Intl.Collator(language, { numeric: true }).compare;
const ORDERS: Record<Sort, (a: StoredFile, b: StoredFile) => number> = {
  name: (a, b) => byName(a.name, b.name),
  time: (a, b) => b.modified_unix_s - a.modified_unix_s,
};

/** Programs that the control keeps, where its panel has a folder for them. */
export function FileList({ files, refresh }: { files: StoredFile[]; refresh: () => Promise<void> }) {
  const [sort, setSort] = useState<Sort>(localStorage.getItem("files-sort") === "time" ? "time" : "name");
  const [search, setSearch] = useState("");
  const [open, setOpen] = useState<string | null>(null);
  const program = useStatus((s) => s.program?.name) ?? undefined;
  const searches = files.length > SEARCH_FROM;
  const found = useMemo(() => {
    const words = searches ? search.toLowerCase().split(/\s+/).filter(Boolean) : [];
    return files.filter(({ name }) => words.every((part) => name.toLowerCase().includes(part))).sort(ORDERS[sort]);
  }, [files, search, sort, searches]);
  const shown = found.slice(0, SHOWN_MAX);
  const opened = files.find(({ name }) => name === open);
  return (
    <>
      <div class="row files-head">
        <h3>{t("files")}</h3>
        <Choice
          label={t("sort")}
          value={sort}
          options={[
            { value: "name", label: t("sort-name"), id: "sort-name" },
            { value: "time", label: t("sort-time"), id: "sort-time" },
          ]}
          onChange={(value) => {
            setSort(value);
            localStorage.setItem("files-sort", value);
          }}
        />
      </div>
      {searches && <Field id="file-search" label={t("search")} value={search} onInput={setSearch} />}
      <ul class="files scroll" aria-label={t("files")} data-testid="files" data-count={found.length} tabIndex={0}>
        {shown.map(({ name, octets, modified_unix_s }) => (
          <li key={name} class="stored" data-testid={`file-${name}`}>
            <Button id={`file-load-${name}`} kind="line" orders="program load" onClick={() => void load(name)}>
              <span>
                <b>{name}</b> {isLoaded(program, name) && <em class="tag">{t("file-loaded")}</em>}
              </span>
              <small>
                {size(octets)} · {dateAndTime(modified_unix_s)}
              </small>
            </Button>
            <Button id={`file-menu-${name}`} icon="more" title={t("file-menu", { name })} onClick={() => setOpen(name)}>
              <span class="hidden">{t("file-menu", { name })}</span>
            </Button>
          </li>
        ))}
        {found.length === 0 && <li class="muted">{t("files-none")}</li>}
        {found.length > SHOWN_MAX && (
          <li class="muted" data-testid="files-more">
            {t("files-more", { n: found.length - SHOWN_MAX })}
          </li>
        )}
      </ul>
      {opened && <FileMenu key={opened.name} file={opened} loaded={isLoaded(program, opened.name)} refresh={refresh} onClose={() => setOpen(null)} />}
    </>
  );
}

/** What can be done with a file beside loading it. */
function FileMenu({ file: { name, octets, modified_unix_s }, loaded, refresh, onClose }: { file: StoredFile; loaded: boolean; refresh: () => Promise<void>; onClose: () => void }) {
  const [next, setNext] = useState(name);
  const [wrong, setWrong] = useState("");
  const [deletes, setDeletes] = useState(false);
  const wanted = next.trim();
  const change = async (work: () => Promise<void>) => {
    if (isBlind()) return setWrong(t("not-sent"));
    try {
      await work();
      onClose();
    } catch (error) {
      const { status, message } = error as HttpRefused;
      setWrong(status === EXISTS ? t("file-exists", { name: wanted }) : message);
    }
    await refresh();
  };
  if (deletes) {
    return (
      <Dialog key="delete" id="file-delete-dialogue" title={t("file-delete", { name })} onClose={onClose}>
        <p>{t("file-delete-explained", { name })}</p>
        {loaded && <p>{t("file-copy")}</p>}
        {wrong && <Wrong text={wrong} />}
        <footer>
          <Button id="file-delete-yes" kind="warn" icon="trash" label={t("file-delete", { name })} orders="program load" onClick={() => void change(() => deleteFile(name))} />
        </footer>
      </Dialog>
    );
  }
  return (
    <Dialog key="menu" id="file-dialogue" title={name} onClose={onClose}>
      <p class="muted">
        {size(octets)} · {dateAndTime(modified_unix_s)}
      </p>
      {loaded && <p>{t("file-copy")}</p>}
      <Form kind="row" onSend={() => void change(() => renameFile(name, wanted))}>
        <Field
          id="file-name"
          label={t("file-name")}
          value={next}
          onInput={(value) => {
            setNext(value);
            setWrong("");
          }}
        />
        <Button id="file-rename" label={t("file-rename")} orders="program load" disabled={!wanted || wanted === name} submit />
      </Form>
      {wrong && <Wrong text={wrong} />}
      <footer>
        <a
          class="button"
          data-testid="file-download"
          href={addressOf(name)}
          download={name}
          onClick={(event) => {
            if (!token) return;
            event.preventDefault();
            downloadFile(name).catch((error: Error) => setWrong(error.message));
          }}
        >
          {t("file-download")}
        </a>
        <Button id="file-delete" icon="trash" label={t("file-delete-short")} orders="program load" onClick={() => setDeletes(true)} />
      </footer>
    </Dialog>
  );
}

function Wrong({ text }: { text: string }) {
  return (
    <p class="error" role="alert" data-testid="file-wrong">
      {text}
    </p>
  );
}
