"use strict";
// Tables whose heads are buttons: a click sorts by that column, another click reverses the order.

// Sorts by data-v of the cells: as numbers if all of them are numbers, else as words. Rows without a value always come
// last.
function sortRows(body, at, ascending) {
  const value = (row) => row.cells[at].dataset.v;
  const rows = [...body.rows];
  const has = rows.filter((row) => value(row) !== undefined && value(row) !== "");
  const numbers = has.every((row) => !Number.isNaN(Number(value(row))));
  const compare = numbers
    ? (a, b) => Number(value(a)) - Number(value(b))
    : (a, b) => value(a).localeCompare(value(b), "en", { numeric: true });
  // Reversed by sign instead of reversing the list, so that equal rows keep their order.
  has.sort((a, b) => (ascending ? 1 : -1) * compare(a, b));
  body.append(...has, ...rows.filter((row) => !has.includes(row)));
}

function markSorted(head, ascending) {
  head.closest("tr").querySelectorAll("[aria-sort]").forEach((other) => other.removeAttribute("aria-sort"));
  head.setAttribute("aria-sort", ascending ? "ascending" : "descending");
}

document.querySelectorAll("table[data-sortable]").forEach((table) => {
  table.tHead.addEventListener("click", (event) => {
    const head = event.target.closest("button") && event.target.closest("th");
    if (!head) return;
    const ascending = head.getAttribute("aria-sort") !== "ascending";
    sortRows(table.tBodies[0], head.cellIndex, ascending);
    markSorted(head, ascending);
  });
});
