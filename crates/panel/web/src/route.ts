/** Which page is shown: the fragment of the address. */
import { useEffect, useState } from "preact/hooks";

export const PAGES = ["operate", "setup", "programs", "jobs", "signals", "bus", "machine"] as const;
export type Page = (typeof PAGES)[number];

const current = (): Page => PAGES.find((page) => location.hash === `#/${page}`) ?? "operate";

export function goTo(page: Page): void {
  location.hash = `#/${page}`;
}

export function usePage(): Page {
  const [page, setPage] = useState(current);
  useEffect(() => {
    const changed = () => setPage(current());
    window.addEventListener("hashchange", changed);
    return () => window.removeEventListener("hashchange", changed);
  }, []);
  return page;
}
