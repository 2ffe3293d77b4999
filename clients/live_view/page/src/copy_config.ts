// The service's configuration, with what was taught to it, into the clipboard; or as a file where a page may not write there.
import { ask } from "./control";
import { save } from "./save";
import { toast } from "./shell";
import { isServing, mayChange } from "./store";

const button = document.getElementById("copy-config") as HTMLButtonElement;
const onPhone = document.querySelector<HTMLElement>("[data-click=copy-config]")!;

// Once a second.
export function updateCopyConfig(): void {
  button.hidden = onPhone.hidden = !isServing() || !mayChange();
}

button.addEventListener("click", async () => {
  button.disabled = true;
  const reply = await ask("config", "show");
  button.disabled = false;
  if (!reply.granted) return toast(reply.reason);
  const text = reply.rows.map(([file, words]) => `# ---- ${file}\n${words.trimEnd()}\n`).join("\n");
  const names = reply.rows.map(([file]) => file).join(" and ");
  try {
    await navigator.clipboard.writeText(text); // not on pages of other hosts without https
    toast(`Copied: ${names}, without passwords.`);
  } catch {
    save(new Blob([text], { type: "text/yaml" }), reply.rows[0][0]);
    toast(`This browser does not let the page copy: ${names} saved as a file.`);
  }
});
