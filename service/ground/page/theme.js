// Light for the sun, dark for the night: the system's wish until the user chooses.

import { forgetColours } from "./canvas.js";

const KEY = "uavdepth-theme";
const wish = matchMedia("(prefers-color-scheme: dark)");

function chosen() {
  try {
    return localStorage.getItem(KEY);
  } catch {
    return null; // storage switched off
  }
}

/** Follow system and button; `onChange` draws anew. */
export function followTheme(button, onChange) {
  const apply = () => {
    const theme = chosen() ?? (wish.matches ? "dark" : "light");
    document.documentElement.dataset.theme = theme;
    button.textContent = theme === "dark" ? "Light" : "Dark";
    forgetColours();
    onChange();
  };
  button.addEventListener("click", () => {
    const theme = document.documentElement.dataset.theme === "dark" ? "light" : "dark";
    try {
      localStorage.setItem(KEY, theme);
    } catch {
      // kept for this visit only
    }
    document.documentElement.dataset.theme = theme;
    button.textContent = theme === "dark" ? "Light" : "Dark";
    forgetColours();
    onChange();
  });
  wish.addEventListener("change", apply);
  apply();
}
