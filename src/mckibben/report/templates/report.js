"use strict";

const source = document.getElementById("figures-data").textContent;
const choices = { recording: 0, models: new Set() };

function unpack(key, value) {
  if (value !== null && typeof value === "object" && typeof value.f4 === "string") {
    const bytes = Uint8Array.from(atob(value.f4), (letter) => letter.charCodeAt(0));
    return Float64Array.from(new Float32Array(bytes.buffer), (x) => x + value.base);
  }
  if (/color$/i.test(key) && typeof value === "string" && value.startsWith("--")) {
    return getComputedStyle(document.documentElement).getPropertyValue(value).trim();
  }
  return value;
}

let figures = JSON.parse(source, unpack);

function styled(layout) {
  const style = getComputedStyle(document.documentElement);
  const colour = (name) => style.getPropertyValue(name).trim();
  const whole = {
    autosize: true,
    hovermode: "closest",
    paper_bgcolor: "rgba(0,0,0,0)",
    plot_bgcolor: "rgba(0,0,0,0)",
    font: { family: getComputedStyle(document.body).fontFamily, size: 12, color: colour("--ink") },
    modebar: { bgcolor: "rgba(0,0,0,0)", color: colour("--muted"), activecolor: colour("--accent") },
    margin: { l: 55, r: 10, t: layout.title ? 50 : 30, b: 45 },
    legend: { orientation: "h", x: 0, xanchor: "left", y: 1, yanchor: "bottom", itemsizing: "constant" },
    ...layout,
  };
  if (layout.title) whole.title = { ...layout.title, font: { size: 13 }, x: 0, y: 1, yanchor: "top", pad: { t: 6 } };
  for (const name of Object.keys(whole).filter((key) => /^[xy]axis/.test(key))) {
    const axis = { exponentformat: "power", gridcolor: colour("--grid"), zerolinecolor: colour("--rule"), zerolinewidth: 1.5 };
    const own = whole[name];
    whole[name] = { ...axis, automargin: true, ...(name[0] === "x" ? { zeroline: false } : {}), ...own };
    if (own.title) whole[name].title = { ...own.title, standoff: 8 };
  }
  return whole;
}

const config = { responsive: true, ...JSON.parse(document.getElementById("bar-data").textContent) };

function draw(place) {
  const variants = figures[place.dataset.figure];
  const plots = variants[Math.min(choices.recording, variants.length - 1)];
  const plot = plots[Number(place.dataset.panel)];
  const data = plot.data.map((trace) => ({
    ...trace,
    visible: trace.meta === null || choices.models.has(trace.meta) || !place.dataset.toggled,
  }));
  return Plotly.react(place, data, styled(plot.layout), config);
}

const places = [...document.querySelectorAll(".plot")];

function redraw(which) {
  places.filter(which).forEach(draw);
}

for (const box of document.querySelectorAll("input[name=model]")) {
  if (box.checked) choices.models.add(box.value);
  box.addEventListener("change", () => {
    choices.models[box.checked ? "add" : "delete"](box.value);
    for (const same of document.querySelectorAll("input[name=model]")) {
      if (same.value === box.value) same.checked = box.checked;
    }
    redraw((place) => place.dataset.toggled);
  });
}

for (const chooser of document.querySelectorAll("select[name=recording]")) {
  chooser.addEventListener("change", () => {
    choices.recording = Number(chooser.value);
    for (const other of document.querySelectorAll("select[name=recording]")) other.value = chooser.value;
    redraw((place) => figures[place.dataset.figure].length > 1);
  });
}

function value(row, column) {
  const told = row.cells[column].dataset.value;
  if (told === undefined || told === "") return null;
  return Number.isNaN(Number(told)) ? told : Number(told);
}

function sort(table, heading) {
  const column = heading.cellIndex;
  const way = heading.getAttribute("aria-sort") === "ascending" ? -1 : 1;
  for (const other of table.tHead.rows[0].cells) other.setAttribute("aria-sort", "none");
  heading.setAttribute("aria-sort", way > 0 ? "ascending" : "descending");
  const body = table.tBodies[0];
  const rows = [...body.rows];
  const order = (a, b) => {
    if (a.dataset.last || b.dataset.last) return (a.dataset.last ? 1 : 0) - (b.dataset.last ? 1 : 0);
    const [x, y] = [value(a, column), value(b, column)];
    if (x === null || y === null) return (x === null ? 1 : 0) - (y === null ? 1 : 0);
    return way * (typeof x === "string" || typeof y === "string" ? String(x).localeCompare(String(y)) : x - y);
  };
  body.append(...rows.sort(order));
}

for (const table of document.querySelectorAll("table[data-sortable]")) {
  for (const heading of table.tHead.rows[0].cells) {
    const button = document.createElement("button");
    button.type = "button";
    button.append(...heading.childNodes);
    heading.append(button);
    button.addEventListener("click", () => sort(table, heading));
  }
}

function recolour() {
  figures = JSON.parse(source, unpack);
  redraw(() => true);
}

matchMedia("(prefers-color-scheme: dark)").addEventListener("change", recolour);

// One plot after another, so that the page can be read and scrolled from the start.
async function start() {
  for (const place of places) {
    await draw(place);
    // The tool bar is for the mouse: a key would have to pass through every button of every plot.
    for (const stop of place.querySelectorAll(".modebar-container a, .modebar-container button, .modebar-container [tabindex]")) stop.tabIndex = -1;
    await new Promise((next) => setTimeout(next));
  }
  document.documentElement.dataset.drawn = "all";
}

start();
