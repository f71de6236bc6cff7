/** Buttons, dialogues and the like, as all pages have them. */
import type { ComponentChildren } from "preact";
import { useLayoutEffect, useRef } from "preact/hooks";
import { t } from "./i18n";
import { isBarred, refuses } from "./orders";
import { type Store, useStore } from "./store";
import type { Role } from "./types";

// Outlines on a grid of 24.
const ICONS = {
  operate: "M4 5h16v11H4zM9 20h6M12 16v4M8 12l3-3 2 2 3-3",
  setup: "M12 3v18M3 12h18M9 6l3-3 3 3M9 18l3 3 3-3M6 9l-3 3 3 3M18 9l3 3-3 3",
  programs: "M6 3h8l4 4v14H6zM14 3v4h4M9 12h6M9 16h6",
  jobs: "M4 4h16v16H4zM8 8h8v8H8zM12 12h.01",
  signals: "M3 12h4l2-6 4 12 3-8 1 2h4",
  bus: "M4 4h6v5H4zM14 4h6v5h-6zM9 15h6v5H9zM7 9v3h10V9M12 12v3",
  machine: "M12 9a3 3 0 1 0 0 6 3 3 0 0 0 0-6zM12 3v3M12 18v3M3 12h3M18 12h3M5.6 5.6l2.2 2.2M16.2 16.2l2.2 2.2M5.6 18.4l2.2-2.2M16.2 7.8l2.2-2.2",
  start: "M7 4l13 8-13 8z",
  hold: "M7 4h4v16H7zM14 4h4v16h-4z",
  resume: "M5 4v16M9 4l11 8-11 8z",
  stop: "M6 6h12v12H6z",
  reset: "M5 12a7 7 0 1 0 2-5M7 3v4h4",
  power: "M12 3v9M7 6a8 8 0 1 0 10 0",
  home: "M4 11l8-7 8 7M6 10v10h12V10M10 20v-6h4v6",
  theme: "M12 4a8 8 0 1 0 0 16zM12 4v16",
  close: "M6 6l12 12M18 6L6 18",
  plus: "M12 5v14M5 12h14",
  minus: "M5 12h14",
  hand: "M8 12V6a1.5 1.5 0 0 1 3 0v5V4.500a1.500 1.500 0 0 1 3 0V11V6a1.500 1.500 0 0 1 3 0v8c0 4-2 7-6 7-3 0-4-1-7-7 0 0 1-2 4 1",
  keys: "M3 7h18v10H3zM6 10h1M10 10h1M14 10h1M17 10h1M8 14h8",
  warning: "M12 4l9 16H3zM12 10v5M12 17v1",
  check: "M4 12l5 5L20 6",
  upload: "M12 16V5M8 9l4-4 4 4M4 19h16",
  more: "M4.500 11h2v2h-2zM11 11h2v2h-2zM17.500 11h2v2h-2z",
  trash: "M5 7h14M10 7V4h4v3M7 7l1 13h8l1-13",
  eye: "M2 12c4-7 16-7 20 0-4 7-16 7-20 0zM12 9a3 3 0 1 0 0 6 3 3 0 0 0 0-6z",
  up: "M12 19V5M6 11l6-6 6 6",
  estop: "M8.500 3h7l5.500 5.500v7l-5.500 5.500h-7L3 15.500v-7zM12 7.500v5.500M12 16v1",
  tool: "M9 3h6v5h-6zM10 8h4v9l-2 4-2-4z",
  message: "M4 5h16v11h-9l-5 4v-4H4z",
} as const;

export type IconName = keyof typeof ICONS;

const FILLED: ReadonlySet<string> = new Set(["start", "hold", "resume", "stop", "more"]);

export function Icon({ name }: { name: IconName }) {
  return (
    <svg class={FILLED.has(name) ? "icon filled" : "icon"} viewBox="0 0 24 24" aria-hidden="true" focusable="false">
      <path d={ICONS[name]} />
    </svg>
  );
}

type ButtonProps = {
  id?: string;
  label?: string;
  icon?: IconName;
  kind?: string;
  /** What the button stands for is on. */
  pressed?: boolean;
  /** What it orders of the control: dim while that would not be carried out; pressed all the same it says why. */
  orders?: string;
  /** The role that may order it, where that is not "operate". */
  needs?: Role;
  /** Dim for another reason. */
  dim?: boolean;
  disabled?: boolean;
  /** It sends the form that it is in. */
  submit?: boolean;
  title?: string;
  onClick?: () => void;
  children?: ComponentChildren;
};

/** Why an order is none for this panel. */
export const barredBecause = ({ role }: Store): string => t(role === "watch" ? "role-watch" : "role-set-up");

export function Button({ id, label, icon, kind = "", pressed, orders, needs, dim, disabled, submit, title, onClick, children }: ButtonProps) {
  // What a role may not do it will not be able to do later on either: said before it is pressed.
  const barred = useStore((s) => (orders !== undefined && isBarred(s, orders, needs) ? barredBecause(s) : null));
  const refused = useStore((s) => orders !== undefined && refuses(s, orders)) || barred !== null;
  return (
    <button
      type={submit ? "submit" : "button"}
      data-testid={id}
      class={`button ${kind}${dim || refused ? " dim" : ""}`}
      aria-pressed={pressed}
      aria-label={children || !label ? undefined : label}
      disabled={disabled}
      title={barred ?? title}
      onClick={onClick}
    >
      {icon && <Icon name={icon} />}
      {label && <span class="label">{label}</span>}
      {children}
    </button>
  );
}

/** A dialogue over the page. Escape closes it only where `onClose` is given, and stops the machine first: see keys.ts. */
export function Dialog({
  id,
  title,
  onClose,
  children,
}: {
  id?: string;
  title: string;
  onClose?: () => void;
  children: ComponentChildren;
}) {
  const element = useRef<HTMLDialogElement>(null);
  // Before anything is typed.
  useLayoutEffect(() => {
    // Not modal: hold and stop stay within reach.
    element.current?.show();
    // Where something is to be typed, typing takes the place of what is there. What asks for a person's hand is not answered by a key
    // that somebody is just pressing: a dialogue that may be closed offers that, another one nothing.
    const field = element.current?.querySelector("input");
    const first = field ?? (onClose && element.current?.querySelector("button"));
    (first ?? element.current)?.focus();
    field?.select();
  }, []);
  return (
    <dialog ref={element} data-testid={id} aria-label={title} class="dialog" tabIndex={-1}>
      <header>
        <h2>{title}</h2>
        {onClose && <Button icon="close" kind="plain" label={t("close")} onClick={onClose} />}
      </header>
      {children}
    </dialog>
  );
}

/** A list of buttons of which one is chosen. */
export function Choice<T extends string | number>({
  label,
  value,
  options,
  onChange,
  id,
}: {
  label: string;
  value: T;
  options: readonly { value: T; label: string; id?: string }[];
  onChange: (value: T) => void;
  id?: string;
}) {
  return (
    <div class="choice" role="group" aria-label={label} data-testid={id}>
      {options.map((option) => (
        <button
          type="button"
          key={option.value}
          data-testid={option.id}
          aria-pressed={option.value === value}
          onClick={() => onChange(option.value)}
        >
          {option.label}
        </button>
      ))}
    </div>
  );
}

export function Card({
  title,
  kind = "",
  tools,
  children,
  id,
  label,
}: {
  title?: string;
  kind?: string;
  tools?: ComponentChildren;
  children?: ComponentChildren;
  id?: string;
  label?: string;
}) {
  return (
    <section class={`card ${kind}`} aria-label={label ?? title} data-testid={id}>
      {(title || tools) && (
        <header>
          {title && <h2>{title}</h2>}
          {tools}
        </header>
      )}
      {children}
    </section>
  );
}

/** Fields and the button that sends them: Enter in a field is that button, and nothing where it is disabled. */
export function Form({ kind = "", onSend, children }: { kind?: string; onSend: () => void; children: ComponentChildren }) {
  return (
    <form
      class={`form ${kind}`}
      onSubmit={(event) => {
        event.preventDefault();
        onSend();
      }}
    >
      {children}
    </form>
  );
}

/** A field for a number or a word, with its label. */
export function Field({
  label,
  value,
  onInput,
  kind = "",
  id,
  numeric,
}: {
  label: string;
  value: string;
  onInput: (value: string) => void;
  kind?: string;
  id?: string;
  numeric?: boolean;
}) {
  return (
    <label class={`field ${kind}`}>
      <span>{label}</span>
      <input
        data-testid={id}
        value={value}
        inputMode={numeric ? "decimal" : "text"}
        autocomplete="off"
        spellcheck={false}
        onInput={(event) => onInput(event.currentTarget.value)}
      />
    </label>
  );
}
