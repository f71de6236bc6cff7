/** Text of a program that was sent from here: shown where the control does not give it. */
let own: { name: string; lines: string[] } | null = null;

export function keepText(name: string, text: string): void {
  own = { name, lines: text.split(/\r?\n/) };
  // It outlasts a reload of the page, if it is not too long for that.
  try {
    sessionStorage.setItem("program", JSON.stringify({ name, text }));
  } catch {
    sessionStorage.removeItem("program");
  }
}

/** Lines of the program of this name and length, if it was sent from here. */
export function ownText(name: string, lines: number): string[] | null {
  if (!own) {
    const kept = sessionStorage.getItem("program");
    if (kept) {
      const { name, text } = JSON.parse(kept) as { name: string; text: string };
      own = { name, lines: text.split(/\r?\n/) };
    }
  }
  return own && own.name === name && Math.abs(own.lines.length - lines) <= 1 ? own.lines : null;
}
