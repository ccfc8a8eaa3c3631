"use strict";
// The filter of tasks. Without it the page can be read all the same.
const form = document.getElementById("filter");
if (form) {
  const failed = document.getElementById("failed");
  const category = document.getElementById("category");
  const count = document.getElementById("count");
  const cards = [...document.querySelectorAll("article.task")];
  const apply = () => {
    let shown = 0;
    for (const card of cards) {
      card.hidden =
        (failed.checked && card.dataset.failed !== "yes") ||
        (category.value !== "" && card.dataset.category !== category.value);
      shown += card.hidden ? 0 : 1;
    }
    count.value = `${shown} of ${cards.length} tasks`;
  };
  form.addEventListener("change", apply);
  form.addEventListener("submit", (event) => event.preventDefault());
  form.hidden = false;
  apply();
}
