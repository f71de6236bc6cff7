/** What is asked beside the socket, as docs/panel-api.md describes it. */
import { t } from "./i18n";
import { authorised } from "./store";

/** A refusal in the words of the control, with its HTTP status; 0: there was no answer. */
export class HttpRefused extends Error {
  constructor(
    readonly status: number,
    message: string,
  ) {
    super(message);
  }
}

export function refusal(status: number, text: string, otherwise: string): HttpRefused {
  try {
    return new HttpRefused(status, (JSON.parse(text) as { error: string }).error);
  } catch {
    return new HttpRefused(status, otherwise || String(status));
  }
}

export async function request(address: string, init: RequestInit & { headers?: Record<string, string> } = {}): Promise<Response> {
  const answer = await fetch(address, { ...init, headers: authorised(init.headers) }).catch(() => {
    throw new HttpRefused(0, t("file-no-answer"));
  });
  if (!answer.ok) throw refusal(answer.status, await answer.text(), answer.statusText);
  return answer;
}
