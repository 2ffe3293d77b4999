// Which parts of the page are visible; others are not drawn.
const hidden = new WeakSet<Element>();
const callbacks = new WeakMap<Element, () => void>();
const observer = new IntersectionObserver(
  (entries) => {
    for (const { target, isIntersecting } of entries) {
      const was = hidden.has(target);
      if (isIntersecting) hidden.delete(target);
      else hidden.add(target);
      if (was && isIntersecting) callbacks.get(target)?.();
    }
  },
  { rootMargin: "100px" }, // so that it is there when it is scrolled to
);

// onSeen: when it comes into view again.
export function watchVisibility(element: Element, onSeen: () => void): void {
  callbacks.set(element, onSeen);
  observer.observe(element);
}

// Everything counts as visible until the browser reports.
export const isHidden = (element: Element) => hidden.has(element);
