// Theme: as the system has it, light for sunlight, or dark. Remembered in this browser.

const KEY = "dfvs-theme";
const CHOICES = ["system", "light", "dark"];
const NAMES = { system: "as the system", light: "light", dark: "dark" };
const prefersDark = matchMedia("(prefers-color-scheme: dark)");

let chosen = CHOICES.includes(localStorage.getItem(KEY)) ? localStorage.getItem(KEY) : "system";

/** @param {() => void} onChange called whenever the colours have changed */
export function startTheme(onChange) {
  const button = document.getElementById("theme");
  const apply = () => {
    const isDark = chosen === "dark" || (chosen === "system" && prefersDark.matches);
    document.documentElement.dataset.theme = isDark ? "dark" : "light";
    button.setAttribute("aria-label", `Theme: ${NAMES[chosen]}`);
    button.title = `Theme: ${NAMES[chosen]}`;
    onChange();
  };
  const next = () => {
    chosen = CHOICES[(CHOICES.indexOf(chosen) + 1) % CHOICES.length];
    localStorage.setItem(KEY, chosen);
    apply();
  };
  button.addEventListener("click", next);
  prefersDark.addEventListener("change", apply);
  apply();
  return next;
}
