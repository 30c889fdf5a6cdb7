"use strict";
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
