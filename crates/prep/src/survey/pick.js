"use strict";
// Joins the ticked cameras into a recipe at the end of the page.
const recipe = document.getElementById("recipe");
function write() {
  const picked = [...document.querySelectorAll("input:checked")];
  const scene = (box) => box.dataset.scene + box.closest("section").dataset.inputs;
  recipe.value = recipe.dataset.head + picked.map(scene).join("");
  document.getElementById("count").textContent = picked.length;
}
document.addEventListener("change", write);
write();
