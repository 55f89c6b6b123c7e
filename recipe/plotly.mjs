// Bundle the parts of plotly.js that reports use, packed for the wheel. In an empty folder:
//
//     npm install plotly.js@4.1.1 esbuild@0.28.2 terser@5.51.4
//     node CLONE/recipe/plotly.mjs CLONE/src/mckibben/report/templates/plotly.min.js.xz
//
// Lines with error bars, shapes and annotations remain. Left out: other traces, the styles of maps,
// menus, sliders, images, grids, colour bars, sums of selections, colour spaces but RGB and HSL, icons
// of other buttons, and the descriptions of attributes. Needs xz.
import { execFileSync } from "node:child_process";
import { readFileSync } from "node:fs";
import { createRequire } from "node:module";

const require = createRequire(`${process.cwd()}/`);
const esbuild = require("esbuild");
const { minify } = require("terser");
const UNUSED = [
  ...["annotations3d", "images", "updatemenus", "sliders", "rangeselector", "rangeslider"],
  ...["grid", "colorbar"],
];
const ICONS = ["camera", "zoombox", "pan", "zoom_plus", "zoom_minus", "home"];
const PARTS = {
  culori: `import { useMode, modeHsl, modeLrgb, modeRgb } from "culori/fn";
    [modeRgb, modeHsl, modeLrgb].forEach(useMode);
    export { converter, formatHex, formatRgb, wcagContrast, wcagLuminance } from "culori/fn";`,
  "gl-mat4": `module.exports = { invert: require("gl-mat4/invert"), multiply: require("gl-mat4/multiply") };`,
  polybooljs: "",
};
/* What plotly.js uses of a package, and nothing of one whose functions no plot calls. */
const OTHER_ICONS = new RegExp(`^    (?!'?(${ICONS.join("|")})'?:)\\S+: \\{\n[^]*?\n    \\},?\n`, "gm");

const slimmer = {
  name: "slimmer",
  setup(build) {
    build.onResolve({ filter: /^(culori|gl-mat4|polybooljs)$/ }, ({ path }) => ({ path, namespace: "part" }));
    build.onLoad({ filter: /.*/, namespace: "part" }, ({ path }) => ({
      contents: PARTS[path],
      resolveDir: process.cwd(),
    }));
    build.onResolve({ filter: /^maplibre-gl\// }, () => ({ path: "none", namespace: "empty" }));
    build.onLoad({ filter: /.*/, namespace: "empty" }, () => ({ contents: "", loader: "text" }));
    build.onLoad({ filter: /plotly\.js\/src\/.*\.js$/ }, ({ path }) => ({
      loader: "js",
      contents: readFileSync(path, "utf8")
        .replace(/\bdescription:\s*\[[\s\S]*?\]\.join\(\s*(''|""|' '|" "|'\\n')\s*\),?/g, "")
        .replace(/\bdescription:\s*'(?:[^'\\\n]|\\.)*'(?=\s*[,}])\s*,?/g, "")
        .replace(path.endsWith("/src/core.js") ? unused() : /$^/, "")
        .replace(path.endsWith("/ploticon.js") ? OTHER_ICONS : /$^/, ""),
    }));
  },
};

function unused() {
  return new RegExp(`\\s*require\\('./components/(${UNUSED.join("|")})'\\),`, "g");
}

const { version } = JSON.parse(readFileSync("node_modules/plotly.js/package.json", "utf8"));
const made = await esbuild.build({
  entryPoints: ["node_modules/plotly.js/lib/core.js"],
  bundle: true,
  minify: true,
  write: false,
  format: "iife",
  globalName: "Plotly",
  define: { global: "window", "define.amd": "false" },
  target: "es2016",
  loader: { ".css": "text" },
  alias: { stream: "stream-browserify" },
  legalComments: "eof",
  banner: { js: `/* plotly.js ${version}, Copyright 2012-2026, Plotly, Inc., MIT licence; lines alone (recipe/plotly.mjs) */` },
  plugins: [slimmer],
});
const { code: script } = await minify(made.outputFiles[0].text, {
  ecma: 2016,
  compress: { passes: 3 },
  format: { comments: /^!|licen[cs]e/i },
});
execFileSync("sh", ["-c", 'xz -c --lzma2=preset=9e,nice=273,depth=2000,pb=0,lc=2 > "$1"', "sh", process.argv[2]], { input: script });
console.log(`${script.length} characters`);
