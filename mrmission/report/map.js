"use strict";
(() => {
  const $ = (id) => document.getElementById(id);
  const data = JSON.parse($("data").textContent);
  const canvas = $("map"), stage = $("stage"), tip = $("tip");
  const context = canvas.getContext("2d");
  const CHUNK = 64; // legs that share one bounding box, for culling and for hovering
  const SURVEY = 1;

  // --- data: differences in cm -> metres, chunks with bounding boxes ------------------------------

  function line(code) {
    const out = new Float64Array(code.length);
    for (let i = 0, east = 0, north = 0; i < code.length; i += 2) {
      out[i] = (east += code[i]) / 100;
      out[i + 1] = (north += code[i + 1]) / 100;
    }
    return out;
  }

  function runs(code, count) {
    const out = new Int32Array(count);
    for (let i = 0, at = 0; i < code.length; i += 2) {
      out.fill(code[i], at, (at += code[i + 1]));
    }
    return out;
  }

  function boxOf(points, from, to) {
    let west = Infinity, south = Infinity, east = -Infinity, north = -Infinity;
    for (let i = from; i <= to; i++) {
      const x = points[2 * i], y = points[2 * i + 1];
      if (x < west) west = x;
      if (x > east) east = x;
      if (y < south) south = y;
      if (y > north) north = y;
    }
    return [west, south, east, north];
  }

  const areas = {};
  for (const name of ["water", "region", "unreached", "cells"]) {
    areas[name] = data[name].map((part) => part.map(line));
  }
  const fences = data.fences.map((fence) => ({ ...fence, ring: line(fence.ring) }));
  let longestTrack = 0;
  const robots = data.robots.map((entry) => {
    const robot = { ...entry, on: true, home: entry.home && line(entry.home) };
    robot.rally = line(entry.rally);
    let travelled = 0;
    robot.sorties = entry.sorties.map((sortie, number) => {
      const points = line(sortie.points), legs = Math.max(points.length / 2 - 1, 0);
      const item = runs(sortie.item, legs), along = new Float64Array(legs + 1), chunks = [];
      for (let i = 1; i < legs; i++) item[i] += item[i - 1];
      along[0] = travelled;
      for (let i = 0; i < legs; i++) {
        travelled += Math.hypot(
          points[2 * i + 2] - points[2 * i], points[2 * i + 3] - points[2 * i + 1]);
        along[i + 1] = travelled;
      }
      for (let from = 0; from < legs; from += CHUNK) {
        const to = Math.min(from + CHUNK, legs);
        chunks.push({ from, to, box: boxOf(points, from, to) });
      }
      return {
        number: number + 1, points, legs, item, along, chunks,
        kind: runs(sortie.kind, legs), lane: runs(sortie.lane, legs), label: sortie.label || [],
      };
    });
    robot.length = travelled;
    longestTrack = Math.max(longestTrack, travelled);
    return robot;
  });
  const conflicts = data.conflicts.map((entry) => ({ ...entry, place: line(entry.place) }));
  const layers = {};
  const drawn = { ...areas, fences, conflicts };
  document.querySelectorAll("input.layer").forEach((box) => {
    layers[box.value] = box.checked;
    // A switch for something that this plan does not have would only puzzle.
    if (drawn[box.value] && !drawn[box.value].length) box.closest("label").hidden = true;
  });

  // --- view ---------------------------------------------------------------------------------------

  const view = { east: 0, north: 0, scale: 1 }; // centre in m, pixels per metre
  let width = 1, height = 1, ratio = 1, fitScale = 1, colours = {}, dark = false;
  let hover = null, queued = false;
  const bounds = [Infinity, Infinity, -Infinity, -Infinity];
  for (const rings of [...areas.water, ...fences.map((fence) => [fence.ring])]) {
    const box = boxOf(rings[0], 0, rings[0].length / 2 - 1);
    for (let i = 0; i < 4; i++) bounds[i] = (i < 2 ? Math.min : Math.max)(bounds[i], box[i]);
  }

  const screenX = (east) => (east - view.east) * view.scale + width / 2;
  const screenY = (north) => (view.north - north) * view.scale + height / 2;

  function fit() {
    const [west, south, east, north] = bounds;
    view.east = (west + east) / 2;
    view.north = (south + north) / 2;
    view.scale = fitScale = Math.min(
      (width - 48) / Math.max(east - west, 1), (height - 64) / Math.max(north - south, 1));
    redraw();
  }

  function zoom(factor, x = width / 2, y = height / 2) {
    const scale = Math.min(Math.max(view.scale * factor, fitScale / 4), 400);
    const east = view.east + (x - width / 2) / view.scale;
    const north = view.north - (y - height / 2) / view.scale;
    view.east = east - (x - width / 2) / scale;
    view.north = north + (y - height / 2) / scale;
    view.scale = scale;
    redraw();
  }

  function pan(dx, dy) {
    view.east -= dx / view.scale;
    view.north += dy / view.scale;
    redraw();
  }

  function resize() {
    const box = stage.getBoundingClientRect(), first = width === 1;
    const whole = Math.abs(view.scale - fitScale) < 1e-9;
    width = Math.max(box.width, 1);
    height = Math.max(box.height, 1);
    ratio = window.devicePixelRatio || 1;
    canvas.width = Math.round(width * ratio);
    canvas.height = Math.round(height * ratio);
    if (first || whole) fit();
    draw();
  }

  function readColours() {
    const style = getComputedStyle(document.documentElement);
    for (const name of ["ink", "soft", "panel", "land", "water", "navigable", "shore", "edge", "fence", "hatch"]) {
      colours[name] = style.getPropertyValue("--" + name).trim();
    }
    dark = window.matchMedia("(prefers-color-scheme: dark)").matches;
  }

  const colourOf = (robot) => (dark ? robot.dark : robot.light);
  const meets = (box) =>
    screenX(box[2]) >= 0 && screenX(box[0]) <= width && screenY(box[1]) >= 0 && screenY(box[3]) <= height;

  // --- drawing ------------------------------------------------------------------------------------

  function ringPath(path, ring) {
    let lastX = NaN, lastY = NaN;
    for (let i = 0; i < ring.length; i += 2) {
      const x = screenX(ring[i]), y = screenY(ring[i + 1]);
      // Points closer than a third of a pixel change nothing that can be seen.
      if (i && i < ring.length - 2 && Math.abs(x - lastX) + Math.abs(y - lastY) < 0.33) continue;
      i ? path.lineTo(x, y) : path.moveTo(x, y);
      lastX = x;
      lastY = y;
    }
    path.closePath();
  }

  function areaPath(parts) {
    const path = new Path2D();
    for (const rings of parts) {
      if (meets(boxOf(rings[0], 0, rings[0].length / 2 - 1))) {
        for (const ring of rings) ringPath(path, ring);
      }
    }
    return path;
  }

  function paintAreas() {
    const water = areaPath(areas.water);
    context.fillStyle = colours.land;
    context.fillRect(0, 0, width, height);
    context.fillStyle = layers.region ? colours.water : colours.navigable;
    context.fill(water, "evenodd");
    if (layers.region) {
      const region = areaPath(areas.region);
      context.fillStyle = colours.navigable;
      context.fill(region, "evenodd");
      context.strokeStyle = colours.edge;
      context.lineWidth = 1;
      context.stroke(region);
    }
    if (layers.unreached && areas.unreached.length) {
      const unreached = areaPath(areas.unreached);
      context.save();
      context.clip(unreached, "evenodd");
      context.strokeStyle = colours.hatch;
      context.lineWidth = 1;
      context.beginPath();
      for (let x = -height; x < width; x += 7) {
        context.moveTo(x, height);
        context.lineTo(x + height, 0);
      }
      context.stroke();
      context.restore();
      context.strokeStyle = colours.hatch;
      context.stroke(unreached);
    }
    if (layers.cells) {
      context.strokeStyle = colours.soft;
      context.lineWidth = 1;
      context.stroke(areaPath(areas.cells));
    }
    context.strokeStyle = colours.shore;
    context.lineWidth = 1.5;
    context.stroke(water);
  }

  function paintFences() {
    context.setLineDash([2, 4]);
    context.lineWidth = 1.4;
    for (const fence of fences) {
      const owners = robots.filter((robot) => robot.on && fence.robots.includes(robot.robot));
      if (!owners.length) continue;
      // A fence of one robot among several wears its colour.
      context.strokeStyle =
        fence.robots.length === 1 && robots.length > 1 ? colourOf(owners[0]) : colours.fence;
      const path = new Path2D();
      ringPath(path, fence.ring);
      context.stroke(path);
    }
    context.setLineDash([]);
  }

  function legPath(robot, kind) {
    const path = new Path2D();
    for (const sortie of robot.sorties) {
      const points = sortie.points;
      for (const chunk of sortie.chunks) {
        if (!meets(chunk.box)) continue;
        let open = false, lastX = 0, lastY = 0;
        for (let i = chunk.from; i < chunk.to; i++) {
          if ((sortie.kind[i] === SURVEY) !== kind) {
            open = false;
            continue;
          }
          if (!open) {
            path.moveTo((lastX = screenX(points[2 * i])), (lastY = screenY(points[2 * i + 1])));
            open = true;
          }
          const x = screenX(points[2 * i + 2]), y = screenY(points[2 * i + 3]);
          const last = i + 1 === chunk.to || (sortie.kind[i + 1] === SURVEY) !== kind;
          if (!last && Math.abs(x - lastX) + Math.abs(y - lastY) < 0.5) continue;
          path.lineTo(x, y);
          lastX = x;
          lastY = y;
        }
      }
    }
    return path;
  }

  const lineWidth = () => Math.min(Math.max(view.scale * 2.2, 1.1), 2.6);

  function paintLegs() {
    context.lineJoin = context.lineCap = "round";
    for (const robot of robots) {
      if (!robot.on) continue;
      context.strokeStyle = colourOf(robot);
      if (layers.lanes) {
        context.lineWidth = lineWidth();
        context.stroke(legPath(robot, true));
      }
      if (layers.transits) {
        context.lineCap = "butt";
        context.lineWidth = Math.max(lineWidth() - 0.4, 1);
        context.setLineDash([5, 3.5]);
        context.stroke(legPath(robot, false));
        context.setLineDash([]);
        context.lineCap = "round";
      }
    }
  }

  function paintArrows() {
    const taken = new Set(), size = 5.2, pitch = 44;
    for (const robot of robots) {
      if (!robot.on) continue;
      context.fillStyle = colourOf(robot);
      context.beginPath();
      for (const sortie of robot.sorties) {
        const points = sortie.points;
        for (const chunk of sortie.chunks) {
          if (!meets(chunk.box)) continue;
          for (let i = chunk.from; i < chunk.to; i++) {
            if (!layers[sortie.kind[i] === SURVEY ? "lanes" : "transits"]) continue;
            const x0 = screenX(points[2 * i]), y0 = screenY(points[2 * i + 1]);
            const dx = screenX(points[2 * i + 2]) - x0, dy = screenY(points[2 * i + 3]) - y0;
            const length = Math.hypot(dx, dy);
            if (length < 22) continue;
            // Every 150 px on a long leg; a coarse grid of taken places keeps arrows apart.
            const count = Math.min(Math.max(Math.round(length / 150), 1), 400);
            for (let n = 0; n < count; n++) {
              const share = (n + 0.5) / count, x = x0 + dx * share, y = y0 + dy * share;
              if (x < -9 || y < -9 || x > width + 9 || y > height + 9) continue;
              const place = Math.floor(x / pitch) * 4096 + Math.floor(y / pitch);
              if (taken.has(place)) continue;
              taken.add(place);
              const ux = dx / length * size, uy = dy / length * size;
              context.moveTo(x + ux * 1.15, y + uy * 1.15);
              context.lineTo(x - ux - uy * 0.8, y - uy + ux * 0.8);
              context.lineTo(x - ux * 0.45, y - uy * 0.45);
              context.lineTo(x - ux + uy * 0.8, y - uy - ux * 0.8);
              context.closePath();
            }
          }
        }
      }
      context.fill();
    }
  }

  // A conflict is shown while both of its robots are.
  const shown = (conflict) =>
    robots.filter((robot) => robot.on && conflict.robots.includes(robot.robot)).length === 2;

  function paintConflicts() {
    context.textAlign = "center";
    context.textBaseline = "middle";
    context.font = "700 11px system-ui, 'DejaVu Sans', sans-serif";
    for (let i = conflicts.length - 1; i >= 0; i--) { // the gravest on top
      const conflict = conflicts[i];
      if (!shown(conflict)) continue;
      const x = screenX(conflict.place[0]), y = screenY(conflict.place[1]);
      if (x < -9 || y < -9 || x > width + 9 || y > height + 9) continue;
      context.beginPath();
      context.moveTo(x, y - 8);
      context.lineTo(x + 8, y + 6);
      context.lineTo(x - 8, y + 6);
      context.closePath();
      context.fillStyle = colours.panel;
      context.fill();
      context.strokeStyle = colours.fence;
      context.lineWidth = 1.6;
      context.stroke();
      context.fillStyle = colours.ink;
      context.fillText("!", x, y + 1.5);
    }
  }

  function conflictAt(x, y) {
    if (!layers.conflicts) return null;
    const near = ({ place }) => Math.hypot(screenX(place[0]) - x, screenY(place[1]) - y) < 9;
    return conflicts.find((conflict) => shown(conflict) && near(conflict)) || null;
  }

  function paintStarts() {
    context.textAlign = "center";
    context.textBaseline = "middle";
    for (const robot of robots) {
      if (!robot.on) continue;
      context.strokeStyle = colourOf(robot);
      context.lineWidth = 2;
      for (let i = 0; i < robot.rally.length; i += 2) {
        const x = screenX(robot.rally[i]), y = screenY(robot.rally[i + 1]);
        context.beginPath();
        context.moveTo(x - 5, y - 5);
        context.lineTo(x + 5, y + 5);
        context.moveTo(x + 5, y - 5);
        context.lineTo(x - 5, y + 5);
        context.stroke();
      }
    }
    // Berths lie metres apart: labels that would overlap are fanned out with a pointer to the spot.
    const placed = [], disc = width < 600 ? 8.5 : 10.5;
    for (const robot of robots) {
      if (!robot.on || !robot.home) continue;
      const x = screenX(robot.home[0]), y = screenY(robot.home[1]);
      let labelX = x, labelY = y;
      for (let step = 0; step < 400; step++) {
        const radius = step ? 2.4 * disc + 1.6 * step : 0, angle = step * 2.399963 - Math.PI / 2;
        labelX = x + radius * Math.cos(angle);
        labelY = y + radius * Math.sin(angle);
        if (placed.every(([px, py]) => Math.hypot(px - labelX, py - labelY) > 2.2 * disc)) break;
      }
      placed.push([labelX, labelY, robot]);
      context.strokeStyle = context.fillStyle = colourOf(robot);
      context.lineWidth = 1.5;
      context.beginPath();
      context.moveTo(x, y);
      context.lineTo(labelX, labelY);
      context.stroke();
      context.beginPath();
      context.arc(x, y, 3, 0, 7);
      context.fill();
    }
    context.font = `700 ${disc + 1.5}px system-ui, 'DejaVu Sans', sans-serif`;
    for (const [labelX, labelY, robot] of placed) {
      context.fillStyle = colourOf(robot);
      context.beginPath();
      context.arc(labelX, labelY, disc, 0, 7);
      context.fill();
      context.strokeStyle = colours.panel;
      context.lineWidth = 2;
      context.stroke();
      context.fillStyle = dark ? "#000" : "#fff";
      context.fillText(robot.robot, labelX, labelY + 0.5);
    }
  }

  function paintHover() {
    if (!hover || !hover.robot.on) return;
    const { robot, sortie, leg } = hover, path = new Path2D(), points = sortie.points;
    let from = leg, to = leg;
    if (sortie.lane[leg]) { // the whole lane, which may be several legs
      while (from > 0 && sortie.lane[from - 1] === sortie.lane[leg]) from--;
      while (to < sortie.legs - 1 && sortie.lane[to + 1] === sortie.lane[leg]) to++;
    }
    for (let i = from; i <= to + 1; i++) {
      const x = screenX(points[2 * i]), y = screenY(points[2 * i + 1]);
      i === from ? path.moveTo(x, y) : path.lineTo(x, y);
    }
    context.strokeStyle = colours.panel;
    context.lineWidth = 9;
    context.stroke(path);
    context.strokeStyle = colourOf(robot);
    context.lineWidth = 5;
    context.stroke(path);
    context.fillStyle = colours.ink;
    context.beginPath();
    context.arc(screenX(points[2 * leg + 2]), screenY(points[2 * leg + 3]), 4.5, 0, 7);
    context.fill();
  }

  function paintScale() {
    const target = 130 / view.scale, power = 10 ** Math.floor(Math.log10(target));
    const step = [5, 2, 1].find((value) => value * power <= target) * power;
    $("bar").style.width = step * view.scale + "px";
    $("bar-text").textContent = step >= 1000 ? step / 1000 + " km" : Number(step.toPrecision(2)) + " m";
  }

  function draw() {
    queued = false;
    context.setTransform(ratio, 0, 0, ratio, 0, 0);
    paintAreas();
    if (layers.fences) paintFences();
    paintLegs();
    if (layers.arrows) paintArrows();
    paintHover();
    if (layers.conflicts) paintConflicts();
    if (layers.starts) paintStarts();
    paintScale();
    document.documentElement.dataset.drawn = "yes";
  }

  function redraw() {
    if (queued) return;
    queued = true;
    requestAnimationFrame(draw);
  }

  // --- words --------------------------------------------------------------------------------------

  function lengthText(metres) {
    if (metres < 999.5) return metres.toFixed(metres < 100 ? 1 : 0) + " m";
    return (metres / 1000).toFixed(2) + " km";
  }

  function legText({ robot, sortie, leg }) {
    const survey = sortie.kind[leg] === SURVEY, lane = sortie.lane[leg];
    const trip = robot.sorties.length > 1 ? ", sortie " + sortie.number : "";
    const what = survey ? (lane ? sortie.label[lane - 1] || "lane " + lane : "survey") : "transit";
    const length = sortie.along[leg + 1] - sortie.along[leg];
    return `Robot ${robot.robot}${trip}: ${what}\nto item ${sortie.item[leg]}, ${lengthText(length)}\n`
      + `${lengthText(sortie.along[leg])} of ${lengthText(robot.length)} from the start`;
  }

  function lonlatText(east, north) {
    const { centre_m: centre, scale_m: scale, degree, lon, lat } = data.lonlat;
    const u = (east - centre[0]) / scale, v = (north - centre[1]) / scale;
    let longitude = 0, latitude = 0;
    for (let i = 0, at = 0; i <= degree; i++) {
      for (let j = 0; j <= degree; j++, at++) {
        const term = u ** i * v ** j;
        longitude += lon[at] * term;
        latitude += lat[at] * term;
      }
    }
    longitude = ((longitude + 180) % 360 + 360) % 360 - 180;
    return `${longitude.toFixed(6)}, ${latitude.toFixed(6)}`;
  }

  // --- finding the leg under the pointer ------------------------------------------------------------

  function legAt(x, y, reach) {
    const east = view.east + (x - width / 2) / view.scale;
    const north = view.north - (y - height / 2) / view.scale;
    let best = null, bestDistance = reach / view.scale;
    for (const robot of robots) {
      if (!robot.on) continue;
      for (const sortie of robot.sorties) {
        const points = sortie.points;
        for (const { from, to, box } of sortie.chunks) {
          if (east < box[0] - bestDistance || east > box[2] + bestDistance) continue;
          if (north < box[1] - bestDistance || north > box[3] + bestDistance) continue;
          for (let i = from; i < to; i++) {
            if (!layers[sortie.kind[i] === SURVEY ? "lanes" : "transits"]) continue;
            const ax = points[2 * i], ay = points[2 * i + 1];
            const dx = points[2 * i + 2] - ax, dy = points[2 * i + 3] - ay;
            const square = dx * dx + dy * dy;
            const share = square ? Math.min(Math.max(((east - ax) * dx + (north - ay) * dy) / square, 0), 1) : 0;
            const distance = Math.hypot(ax + share * dx - east, ay + share * dy - north);
            if (distance < bestDistance) {
              bestDistance = distance;
              best = { robot, sortie, leg: i };
            }
          }
        }
      }
    }
    return best;
  }

  function showTip(leg, x, y) {
    const changed = !(hover && leg && hover.sortie === leg.sortie && hover.leg === leg.leg);
    if (changed && (hover || leg)) {
      hover = leg;
      redraw();
    }
    const meeting = conflictAt(x, y);
    tip.hidden = !leg && !meeting;
    if (tip.hidden) return;
    tip.textContent = meeting ? meeting.text : legText(leg);
    const box = tip.getBoundingClientRect();
    tip.style.left = Math.max(4, x + 16 + box.width > width ? x - box.width - 12 : x + 16) + "px";
    tip.style.top = Math.max(4, y + 16 + box.height > height ? y - box.height - 12 : y + 16) + "px";
  }

  function step(direction) {
    let list = robots.filter((robot) => robot.on && robot.sorties.some((sortie) => sortie.legs));
    if (!list.length) return;
    let { robot, sortie, leg } = hover && hover.robot.on ? hover : {};
    if (!robot) {
      robot = list[0];
      sortie = robot.sorties.find((entry) => entry.legs);
      leg = direction > 0 ? 0 : sortie.legs - 1;
    } else {
      leg += direction;
      while (leg < 0 || leg >= sortie.legs) {
        const place = (robot.sorties.indexOf(sortie) + direction + robot.sorties.length) % robot.sorties.length;
        sortie = robot.sorties[place];
        leg = direction > 0 ? 0 : sortie.legs - 1;
        if (sortie.legs) break;
      }
    }
    const east = (sortie.points[2 * leg] + sortie.points[2 * leg + 2]) / 2;
    const north = (sortie.points[2 * leg + 1] + sortie.points[2 * leg + 3]) / 2;
    if (!meets([east, north, east, north])) {
      view.east = east;
      view.north = north;
    }
    showTip({ robot, sortie, leg }, screenX(east), screenY(north));
    redraw();
  }

  // --- input --------------------------------------------------------------------------------------

  const pointers = new Map();
  let pinch = 0;

  function place(event) {
    const box = canvas.getBoundingClientRect();
    return [event.clientX - box.left, event.clientY - box.top];
  }

  canvas.addEventListener("pointerdown", (event) => {
    pointers.set(event.pointerId, place(event));
    try {
      canvas.setPointerCapture(event.pointerId);
    } catch { /* a synthetic event has no pointer to capture */ }
    pinch = 0;
    if (event.pointerType !== "mouse") showTip(legAt(...place(event), 14), ...place(event));
  });
  canvas.addEventListener("pointermove", (event) => {
    const [x, y] = place(event), old = pointers.get(event.pointerId);
    $("cursor").textContent = lonlatText(
      view.east + (x - width / 2) / view.scale, view.north - (y - height / 2) / view.scale);
    if (!old) return showTip(legAt(x, y, 8), x, y);
    pointers.set(event.pointerId, [x, y]);
    if (pointers.size === 1) {
      pan(x - old[0], y - old[1]);
    } else if (pointers.size === 2) {
      const [[ax, ay], [bx, by]] = [...pointers.values()];
      const distance = Math.hypot(ax - bx, ay - by);
      if (pinch) zoom(distance / pinch, (ax + bx) / 2, (ay + by) / 2);
      pan((x - old[0]) / 2, (y - old[1]) / 2);
      pinch = distance;
    }
    if (pointers.size && Math.hypot(x - old[0], y - old[1]) > 1) showTip(null);
  });
  for (const name of ["pointerup", "pointercancel"]) {
    canvas.addEventListener(name, (event) => {
      pointers.delete(event.pointerId);
      pinch = 0;
    });
  }
  canvas.addEventListener("pointerleave", (event) => {
    if (event.pointerType === "mouse" && !pointers.size) {
      showTip(null);
      $("cursor").textContent = "";
    }
  });
  canvas.addEventListener("wheel", (event) => {
    event.preventDefault();
    const unit = event.deltaMode === 1 ? 30 : event.deltaMode === 2 ? 300 : 1;
    const amount = Math.min(Math.max(event.deltaY * unit, -300), 300);
    zoom(Math.exp(-amount / 320), ...place(event));
  }, { passive: false });
  canvas.addEventListener("dblclick", (event) => zoom(2, ...place(event)));
  const keys = {
    ArrowLeft: () => pan(60, 0), ArrowRight: () => pan(-60, 0),
    ArrowUp: () => pan(0, 60), ArrowDown: () => pan(0, -60),
    "+": () => zoom(1.4), "=": () => zoom(1.4), "-": () => zoom(1 / 1.4), "_": () => zoom(1 / 1.4),
    0: fit, Home: fit, n: () => step(1), N: () => step(1), p: () => step(-1), P: () => step(-1),
    Escape: () => showTip(null),
  };
  canvas.addEventListener("keydown", (event) => {
    if (event.ctrlKey || event.metaKey || event.altKey || !keys[event.key]) return;
    event.preventDefault();
    keys[event.key]();
  });
  $("in").addEventListener("click", () => zoom(1.5));
  $("out").addEventListener("click", () => zoom(1 / 1.5));
  $("fit").addEventListener("click", fit);

  const boxes = [...document.querySelectorAll("input.robot")];
  function show(wanted) {
    for (const box of boxes) box.checked = wanted(Number(box.value));
    apply();
  }
  function apply() {
    const on = new Set(boxes.filter((box) => box.checked).map((box) => Number(box.value)));
    for (const robot of robots) robot.on = on.has(robot.robot);
    if (hover && !hover.robot.on) showTip(null);
    redraw();
  }
  for (const box of boxes) box.addEventListener("change", apply);
  $("all").addEventListener("click", () => show(() => true));
  $("none").addEventListener("click", () => show(() => false));
  $("robots").addEventListener("click", (event) => {
    const row = event.target.closest("tr");
    if (!row || event.target.closest("label")) return;
    const wanted = Number(row.dataset.robot);
    const alone = boxes.every((box) => box.checked === (Number(box.value) === wanted));
    show((robot) => alone || robot === wanted);
  });
  document.querySelectorAll("input.layer").forEach((box) =>
    box.addEventListener("change", () => {
      layers[box.value] = box.checked;
      redraw();
    }));

  window.matchMedia("(prefers-color-scheme: dark)").addEventListener("change", () => {
    readColours();
    redraw();
  });
  for (const name of ["beforeprint", "afterprint"]) {
    window.addEventListener(name, () => {
      readColours();
      if (name === "beforeprint") dark = false;
      resize();
    });
  }
  new ResizeObserver(resize).observe(stage);
  apply(); // a browser may bring back the switches of the last visit
  document.querySelectorAll("input.layer").forEach((box) => (layers[box.value] = box.checked));
  readColours();
  resize();
})();
