// Colours of the map for light and dark ground. The page's own colours are in style.css.
import type { LandmarkState } from "../words/states";

export interface Colours {
  wall: string;
  text: string;
  halo: string;
  robot: string;
  stale: string;
  accent: string;
  state: Record<LandmarkState, string>;
}

const LIGHT: Colours = {
  wall: "#39424f",
  text: "#181c22",
  halo: "#ffffffd9",
  robot: "#0f766e",
  stale: "#8b95a5",
  accent: "#1d4ed8",
  state: {
    active: "#15803d",
    "not-placed": "#a14d04",
    learning: "#1d4ed8",
    "not-learnt": "#566070",
    inactive: "#a14d04",
    flagged: "#c2410c",
    quarantined: "#b91c1c",
  },
};

const DARK: Colours = {
  wall: "#b7c0cd",
  text: "#e8ebf0",
  halo: "#14171cd9",
  robot: "#2dd4bf",
  stale: "#667080",
  accent: "#60a5fa",
  state: {
    active: "#4ade80",
    "not-placed": "#fbbf24",
    learning: "#60a5fa",
    "not-learnt": "#a3adbb",
    inactive: "#fbbf24",
    flagged: "#fb923c",
    quarantined: "#f87171",
  },
};

/** The colours of the present appearance. */
export function colours(): Colours {
  const theme = document.documentElement.dataset.theme;
  const isDark = theme ? theme === "dark" : matchMedia("(prefers-color-scheme: dark)").matches;
  return isDark ? DARK : LIGHT;
}
