/* The room for the action: the part of the window that title, panels, card, sliders and bar leave free. The camera frames the action in it. */

const LEAST_ROOM = [160, 120]; // pixels, however much is open
const NARROW = 820; // pixels, of a window in which the card lies below the scene

function isSeen(part) { return part !== null && !part.hidden && part.getClientRects().length > 0; }

/* The free rectangle, in pixels of the window. */
function freeRoom() {
  const width = window.innerWidth, height = window.innerHeight, narrow = width <= NARROW;
  const room = {left: 0, top: 0, right: width, bottom: height};
  if (document.body.classList.contains("bare")) { return room; }
  const header = document.querySelector("header"), card = document.getElementById("impact");
  if (isSeen(header)) { room.top = header.getBoundingClientRect().bottom; }
  for (const part of document.querySelectorAll("footer, .panel")) {
    if (isSeen(part)) { room.bottom = Math.min(room.bottom, part.getBoundingClientRect().top); }
  }
  if (isSeen(card)) {
    const box = card.getBoundingClientRect();
    if (narrow) { room.bottom = Math.min(room.bottom, box.top); } else { room.right = box.left; }
  }
  const sliders = document.querySelector("#controls[open]");
  if (isSeen(sliders) && !narrow) { room.right = Math.min(room.right, sliders.getBoundingClientRect().left); }
  for (const box of [...document.querySelectorAll("header details[open] > div")].filter(isSeen).map((part) => part.getBoundingClientRect())) {
    if (narrow) { room.top = Math.max(room.top, box.bottom); } else { room.left = Math.max(room.left, box.right); }
  }
  const [wide, tall] = LEAST_ROOM;
  if (room.bottom - room.top < tall) { room.top = Math.max(room.bottom - tall, 0); }
  if (room.right - room.left < wide) { room.left = Math.max(room.right - wide, 0); }
  room.bottom = Math.max(room.bottom, room.top + tall);
  return room;
}

/* Tells the style sheet how high head and bar are: panels and card lie between them. */
function fitHeights() {
  const set = (name, value) => document.documentElement.style.setProperty(name, `${Math.round(value)}px`);
  set("--foot", element("bar").parentElement.getBoundingClientRect().height);
  set("--head", document.querySelector("header").getBoundingClientRect().bottom);
}
