// Disabled buttons say why: in words below them, as a tooltip shows nothing on a phone.
const reasons = new WeakMap<HTMLButtonElement, string>();

// why: empty enables it.
export function enable(button: HTMLButtonElement, why: string): void {
  reasons.set(button, why);
  if (button.disabled !== (why !== "")) button.disabled = why !== "";
  const hint = button.closest(".tool-foot, .box-details, .hinted")?.querySelector<HTMLElement>(":scope > .hint");
  if (!hint) return;
  // Buttons with one reason share a line.
  const groups = new Map<string, string[]>();
  for (const other of hint.parentElement!.querySelectorAll<HTMLButtonElement>("button:disabled:not([hidden])")) {
    const reason = reasons.get(other);
    if (reason && !other.closest("[hidden]")) groups.set(reason, [...(groups.get(reason) ?? []), other.textContent!.replace("…", "")]);
  }
  const text = [...groups].map(([reason, names]) => `${names.join(", ")}: ${reason}`).join(" · ");
  if (hint.textContent !== text) hint.textContent = text;
}
