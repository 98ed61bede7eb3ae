// Light, dark, or as the system has it. Kept in this browser.
const WORDS = { system: "Theme: system", light: "Theme: light", dark: "Theme: dark" } as const;
type Choice = keyof typeof WORDS;
const KEY = "waymark-appearance";

function stored(): Choice {
  const value = localStorage.getItem(KEY);
  return value === "light" || value === "dark" ? value : "system";
}

let choice = $state<Choice>(stored());
apply();

function apply(): void {
  if (choice === "system") delete document.documentElement.dataset.theme;
  else document.documentElement.dataset.theme = choice;
}

export const appearance = {
  get word() {
    return WORDS[choice];
  },
};

export function nextAppearance(): void {
  choice = choice === "system" ? "light" : choice === "light" ? "dark" : "system";
  if (choice === "system") localStorage.removeItem(KEY);
  else localStorage.setItem(KEY, choice);
  apply();
}
