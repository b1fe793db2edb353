/* Lets the browser's Back button return to a page on which something was missing. */

/**
 * Give a page that came back with errors an ordinary address in the browser's history.
 *
 * Such a page is the answer to a form, and a browser that returns to it asks whether the form is to be sent again.
 * The form's `data-returning` is the address that shows the page anew. The page takes it only when somebody sends the
 * form or follows a link, even one within the page, which has a place of its own in the history: until then a reload
 * keeps the answers.
 */
export function easeReturning(root) {
  const summary = root.querySelector("[data-error-summary]");
  const form = root.querySelector("form[data-returning]");
  if (summary === null || form === null) {
    return;
  }
  const takeAddress = () => history.replaceState(null, "", form.dataset.returning);
  form.addEventListener("submit", takeAddress);
  root.addEventListener("click", (event) => {
    if (event.target.closest("a") !== null) {
      takeAddress();
    }
  });
}
