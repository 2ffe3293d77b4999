// Undo and redo of the saves into the taught file: buttons with data-history="undo" and "redo".
import { ask } from "./control";
import type { ControlReply } from "./messages";

const words = { undo: "Undo", redo: "Redo" } as const;
type Word = keyof typeof words;
const buttons = () => [...document.querySelectorAll<HTMLButtonElement>("button[data-history]")];

function show(reply: ControlReply): void {
  if (!reply.granted) return;
  const left = Object.fromEntries(reply.rows.map(([key, count, change]) => [key, { count: Number(count), change: change ?? "" }]));
  for (const button of buttons()) {
    const word = button.dataset.history as Word;
    const { count, change } = left[`${word}able`] ?? { count: 0, change: "" };
    button.disabled = false;
    button.hidden = !count; // nothing to undo: no button
    // One history for all tools: the button names the change, which may be of another tool.
    button.textContent = change ? `${words[word]}: ${change}` : words[word];
    button.setAttribute("aria-label", `${words[word]}: ${change || "the last save"}; ${count} can be ${word === "undo" ? "undone" : "redone"}`);
  }
}

// After a save, and when a panel with such buttons opens.
export async function updateHistory(): Promise<void> {
  show(await ask("history"));
}

export async function stepHistory(word: Word): Promise<ControlReply> {
  for (const button of buttons()) button.disabled = true;
  const reply = await ask(word);
  if (reply.granted) show(reply);
  else void updateHistory();
  return reply;
}

// The buttons PANEL-undo and PANEL-redo; then: what a panel does with the answer.
export function whenStepped(panel: string, then: (reply: ControlReply) => void): void {
  for (const word of Object.keys(words) as Word[])
    document.getElementById(`${panel}-${word}`)!.addEventListener("click", async () => then(await stepHistory(word)));
}
