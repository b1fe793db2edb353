/* Runs before the first paint, so that nothing is shown that the other scripts would take away again. */

{
  /* The styles hold pictures back, or show only a video's first, while the page `is-starting`. Whatever goes wrong with
     the other scripts, that ends. */
  const LIMIT_MS = 10000;
  const page = document.documentElement;
  const start = () => page.classList.remove("is-starting");
  if ("noModule" in HTMLScriptElement.prototype) {
    page.classList.add("is-starting");
    setTimeout(start, LIMIT_MS);
    const isScript = (event) => event instanceof ErrorEvent || event.target instanceof HTMLScriptElement;
    window.addEventListener("error", (event) => isScript(event) && start(), true);
  }
}
