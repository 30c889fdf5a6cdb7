"use strict";
// The pictures of a scene: the slider between prediction and truth, and the kind of picture that the gallery shows.

const form = document.getElementById("compare-form");
const kinds = document.getElementById("kinds");

if (form) {
  const split = document.getElementById("split");
  const slider = split.parentElement;

  const move = () => slider.style.setProperty("--at", `${split.value}%`);

  const thumbnail = (method, view) =>
    [...document.querySelectorAll(".pick")].find((pick) => pick.dataset.method === method && pick.dataset.view === view);

  // The address of a picture of this kind; null if there is none.
  const picture = (pick, kind) => {
    const image = pick && pick.querySelector("img");
    return image && image.dataset.kinds.split(" ").includes(kind) ? `${image.dataset.base}${kind}.png` : null;
  };

  const show = (image, source, words) => {
    image.hidden = !source;
    if (source) image.src = source;
    image.alt = words;
  };

  const compare = () => {
    const { method, view, kind } = Object.fromEntries(new FormData(form));
    const name = form.elements.method.selectedOptions[0].textContent;
    const pick = thumbnail(method, view);
    const truth = picture(document.querySelector(`.gallery tbody tr .pick[data-view="${view}"]`), kind);
    show(document.getElementById("prediction"), picture(pick, kind), `Prediction of ${name}, ${view}`);
    show(document.getElementById("truth"), truth, `Truth, ${view}`);
    const error = picture(pick, form.elements.kind.selectedOptions[0].dataset.error);
    document.getElementById("heat").hidden = !error;
    show(document.getElementById("error"), error, `Error of ${name}, ${view}`);
    document.querySelectorAll(".pick").forEach((other) => other.setAttribute("aria-pressed", other === pick));
  };

  const gallery = () => {
    const kind = new FormData(kinds).get("kind");
    document.querySelectorAll(".pick").forEach((pick) => {
      const image = pick.querySelector("img");
      const source = picture(pick, kind);
      image.classList.toggle("none", !source);
      if (source) image.src = source;
    });
  };

  split.addEventListener("input", move);
  form.addEventListener("input", compare);
  kinds.addEventListener("input", gallery);
  document.querySelector(".gallery").addEventListener("click", (event) => {
    const pick = event.target.closest(".pick");
    if (!pick) return;
    const isOption = [...form.elements.method.options].some((option) => option.value === pick.dataset.method);
    if (isOption) form.elements.method.value = pick.dataset.method;
    form.elements.view.value = pick.dataset.view;
    compare();
    document.getElementById("compare").scrollIntoView({ block: "nearest" });
  });
  move();
  compare();
  gallery();
}
