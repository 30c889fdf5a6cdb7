"use strict";
// The pictures of a scene: those that the sliders compare, and the kind of picture that the gallery shows.

const form = document.getElementById("compare-form");
const kinds = document.getElementById("kinds");

if (form) {
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
    const words = new FormData(form);
    const [method, view, shown] = [words.get("method"), words.get("view"), words.getAll("kind")];
    const name = form.elements.method.selectedOptions[0].textContent;
    const pick = thumbnail(method, view);
    const truth = thumbnail("_truth", view);
    document.querySelectorAll("#compare .kind").forEach((part) => {
      const { kind, error } = part.dataset;
      const title = part.querySelector("figcaption").textContent;
      // A single kind has no box to choose it by.
      part.hidden = form.elements.kind && !shown.includes(kind);
      show(part.querySelector(".prediction img"), picture(pick, kind), `${title} by ${name}, ${view}`);
      show(part.querySelector(".truth img"), picture(truth, kind), `${title}, truth, ${view}`);
      const heat = picture(pick, error);
      part.querySelector(".heat").hidden = !heat;
      show(part.querySelector(".heat img"), heat, `${title}: error of ${name}, ${view}`);
    });
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
  compare();
  gallery();
}
