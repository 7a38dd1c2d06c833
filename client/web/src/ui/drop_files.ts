// Files that the user drops on the page.

export function takeDrops(take: (file: File) => void): void {
  const setDropping = (on: boolean) => document.body.classList.toggle('dropping', on);
  window.addEventListener('dragover', (event) => {
    if (!event.dataTransfer?.types.includes('Files')) return; // a dragged text or picture of the page is no scene
    event.preventDefault();
    setDropping(true);
  });
  // A drag that leaves one element for another names the other; a drag that leaves the page names none.
  window.addEventListener('dragleave', (event) => {
    if (!event.relatedTarget) setDropping(false);
  });
  window.addEventListener('drop', (event) => {
    setDropping(false);
    const file = event.dataTransfer?.files[0];
    if (!file) return;
    event.preventDefault();
    take(file);
  });
}
