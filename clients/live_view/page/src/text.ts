// Texts that are computed again every second: the same one again would cost a layout and, for readers, an announcement.
export function write(element: Element, text: string): void {
  if (element.textContent !== text) element.textContent = text;
}
export function label(element: Element, text: string): void {
  if (element.getAttribute("aria-label") !== text) element.setAttribute("aria-label", text);
}
