import { vitePreprocess } from "@sveltejs/vite-plugin-svelte";

// Without runes, a component that uses none is compiled in the legacy mode, where `<part.page />` never changes.
export default { preprocess: vitePreprocess(), compilerOptions: { runes: true } };
