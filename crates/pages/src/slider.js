"use strict";
// Pictures that are shown larger than they are keep their pixels: blurred ones would look like smooth predictions.
const sharpen = new ResizeObserver((entries) => {
  for (const { target } of entries) {
    target.classList.toggle("enlarged", target.clientWidth * devicePixelRatio > target.naturalWidth + 1);
  }
});
document.querySelectorAll("main img").forEach((image) => {
  sharpen.observe(image);
  // Its own size is known now, or a picture of another size is shown in its place.
  image.addEventListener("load", () => { sharpen.unobserve(image); sharpen.observe(image); });
});

// Lays the truth over the prediction, to the left of a line that the range moves. The sliders of a group move
// together.

document.querySelectorAll(".slider").forEach((slider) => {
  slider.classList.add("live");
  slider.querySelector("input").addEventListener("input", (event) => {
    slider.closest(".sliders").querySelectorAll(".slider input").forEach((range) => {
      range.value = event.target.value;
      range.parentElement.style.setProperty("--at", `${range.value}%`);
    });
  });
});
