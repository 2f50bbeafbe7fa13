"use strict";
// One time for all plots and the video: pointing at a plot reads its curves there and seeks the video.
const charts = [...document.querySelectorAll("svg[data-from]")].map((svg) => {
  const read = Object.fromEntries(Object.entries(svg.dataset).map(([k, v]) => [k, Number(v)]));
  const cursor = svg.querySelector("line").cloneNode();
  cursor.setAttribute("class", "cursor");
  cursor.setAttribute("y1", read.top);
  cursor.setAttribute("y2", read.bottom);
  cursor.style.display = "none";
  svg.append(cursor);
  const keys = [...svg.parentElement.querySelectorAll(".key")].filter((key) => key.lastChild.tagName === "OUTPUT");
  const curves = keys.map((key) => ({
    output: key.lastChild,
    points: [...svg.querySelectorAll(`polyline.${key.classList[1]}`)]
      .flatMap((line) => [...line.points].map((p) => [p.x, p.y])),
  }));
  return { svg, read, cursor, curves };
});
const video = document.querySelector("video");
const valueAt = ({ read }, y) => {
  const share = (read.bottom - y) / (read.bottom - read.top);
  return read.log ? read.low * (read.high / read.low) ** share : read.low + share * (read.high - read.low);
};
const show = (t) => charts.forEach((chart) => {
  const { read, cursor, curves } = chart;
  const x = read.left + (t - read.from) / (read.to - read.from) * (read.right - read.left);
  const inside = x >= read.left && x <= read.right;
  cursor.style.display = inside ? "" : "none";
  cursor.setAttribute("x1", x);
  cursor.setAttribute("x2", x);
  for (const { output, points } of curves) {
    let best = null;
    for (const p of points) if (Math.abs(p[0] - x) < 4 && (!best || Math.abs(p[0] - x) < Math.abs(best[0] - x))) best = p;
    output.textContent = inside && best ? valueAt(chart, best[1]).toPrecision(3) : "";
  }
});
for (const { svg, read } of charts) {
  svg.addEventListener("pointermove", (event) => {
    const box = svg.getBoundingClientRect();
    const x = (event.clientX - box.left) / box.width * svg.viewBox.baseVal.width;
    const t = read.from + (x - read.left) / (read.right - read.left) * (read.to - read.from);
    show(t);
    if (video && video.paused) video.currentTime = Math.max(t - Number(video.dataset.from), 0);
  });
}
if (video) video.addEventListener("timeupdate", () => { if (!video.paused) show(video.currentTime + Number(video.dataset.from)); });
