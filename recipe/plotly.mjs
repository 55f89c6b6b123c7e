// Bundle the parts of plotly.js that reports use, packed for the wheel. In an empty folder:
//
//     npm install plotly.js@4.1.1 esbuild@0.28.2
//     node CLONE/recipe/plotly.mjs CLONE/src/mckibben/report/templates/plotly.min.js.xz
//
// Lines with error bars, shapes and annotations remain. Left out: other traces, the styles of maps,
// menus, sliders, images, and the descriptions of attributes. Needs xz.
import { execFileSync } from "node:child_process";
import { readFileSync } from "node:fs";
import { createRequire } from "node:module";

const esbuild = createRequire(`${process.cwd()}/`)("esbuild");
const UNUSED = ["annotations3d", "images", "updatemenus", "sliders", "rangeselector"];

const slimmer = {
  name: "slimmer",
  setup(build) {
    build.onResolve({ filter: /^maplibre-gl\// }, () => ({ path: "none", namespace: "empty" }));
    build.onLoad({ filter: /.*/, namespace: "empty" }, () => ({ contents: "", loader: "text" }));
    build.onLoad({ filter: /plotly\.js\/src\/.*\.js$/ }, ({ path }) => ({
      loader: "js",
      contents: readFileSync(path, "utf8")
        .replace(/\bdescription:\s*\[[\s\S]*?\]\.join\(\s*(''|""|' '|" "|'\\n')\s*\),?/g, "")
        .replace(/\bdescription:\s*'(?:[^'\\\n]|\\.)*'(?=\s*[,}])\s*,?/g, "")
        .replace(path.endsWith("/src/core.js") ? unused() : /$^/, ""),
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
const script = made.outputFiles[0].text;
execFileSync("sh", ["-c", 'xz -c --lzma2=preset=9e,nice=273,depth=2000,pb=0,lc=2 > "$1"', "sh", process.argv[2]], { input: script });
console.log(`${script.length} characters`);
