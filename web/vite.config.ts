import { svelte } from "@sveltejs/vite-plugin-svelte";
import { defineConfig } from "vitest/config";
// @ts-expect-error: a tool without types
import { licences } from "./tools/licences.js";

// `npm run dev` shows the pages of this folder with the data of a running server.
const server = process.env.WAYMARK_URL ?? "http://127.0.0.1:8080";
const proxied = {
  target: server,
  changeOrigin: true,
  // The server takes changes from its own pages alone.
  headers: { origin: server },
};

export default defineConfig({
  plugins: [svelte(), licences()],
  build: {
    target: "es2022",
    assetsInlineLimit: 0,
    modulePreload: { polyfill: false },
    chunkSizeWarningLimit: 400,
    reportCompressedSize: true,
  },
  server: { proxy: { "/api": proxied, "/open": proxied, "/login": proxied, "/logout": proxied } },
  test: { include: ["tests/unit/**/*.test.ts"] },
});
