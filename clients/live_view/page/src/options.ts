// Sets the options of a list, as [value, text]; keeps the selection if it is still available.
export function setOptions(select: HTMLSelectElement, options: [string, string][]): void {
  if ([...select.options].map((o) => o.value).join("\n") === options.map(([value]) => value).join("\n")) return;
  const chosen = select.value;
  select.replaceChildren(...options.map(([value, text]) => new Option(text, value)));
  if (options.some(([value]) => value === chosen)) select.value = chosen;
}
