// What the page remembers in this browser.
const key = "huetrack-settings";
type Value = string | number | boolean;

function all(): Record<string, Value> {
  try {
    return JSON.parse(localStorage.getItem(key) ?? "{}") as Record<string, Value>;
  } catch {
    return {}; // a browser that keeps nothing, or another version's text
  }
}

export function setting(name: string, otherwise: string): string;
export function setting(name: string, otherwise: number): number;
export function setting(name: string, otherwise: boolean): boolean;
export function setting(name: string, otherwise: Value): Value {
  const value = all()[name];
  return typeof value === typeof otherwise ? value : otherwise;
}

export function remember(name: string, value: Value): void {
  try {
    localStorage.setItem(key, JSON.stringify({ ...all(), [name]: value }));
  } catch {
    // a browser that keeps nothing
  }
}

// A list whose choice is remembered. Call it after the listeners of its changes are there: a remembered choice is announced to them.
export function rememberChoice(select: HTMLSelectElement): void {
  const chosen = setting(select.id, select.value);
  select.addEventListener("change", () => remember(select.id, select.value));
  if (chosen === select.value || ![...select.options].some((o) => o.value === chosen)) return;
  select.value = chosen;
  select.dispatchEvent(new Event("change"));
}
