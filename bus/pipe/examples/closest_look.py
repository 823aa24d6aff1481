#!/usr/bin/env python3
"""An explorer: to the closest place that sees something unknown. It needs Python, and nothing of elk."""
import collections, itertools, json, math, sys, time

FACES = [(1, 0, 0), (-1, 0, 0), (0, 1, 0), (0, -1, 0), (0, 0, 1), (0, 0, -1)]
SIGHT, LOOKS = 15, 4  # voxels from which something is looked at; looks in vain before it is given up
known, walls = {}, collections.Counter()  # by voxel: "." or "#"; how many occupied ones are too near
frontier, tried, plans, last, request = set(), collections.defaultdict(set), 0, None, None

def say(**line): print(json.dumps(line), flush=True)
def add(v, d): return v[0] + d[0], v[1] + d[1], v[2] + d[2]
def around(n): return itertools.product(range(-n, n + 1), repeat=3)
def beside(v): return [add(v, d) for d in FACES]
def centre(v): return [(c + 0.5) * res for c in v]
def voxel(v): return dict(zip("xyz", v))
def unknown(v): return [w for w in beside(v) if w not in known and all(abs(c - m) <= d / 2 for c, m, d in zip(centre(w), mid, dim))]
def has_room(v): return known.get(v) == "." and not walls[v]
def line(a, b, fine):  # the voxels between the centres of two
    n = fine * max(abs(q - p) for p, q in zip(a, b)) or 1
    return (tuple(math.floor(p + 0.5 + (q - p) * k / n) for p, q in zip(a, b)) for k in range(n + 1))
def take(brick, cells):  # x runs fastest
    for i, cell in enumerate(cells):
        v = add([8 * c for c in brick], (i % 8, i // 8 % 8, i // 64))
        if cell != known.get(v, "?"):
            for d in around(math.ceil(radius / res - 1e-9)) if "#" in (cell, known.get(v)) else ():
                walls[add(v, d)] += 1 if cell == "#" else -1
            known[v] = cell
            for w in [v] + beside(v):
                (frontier.add if known.get(w) == "." and unknown(w) else frontier.discard)(w)
def looking(v, u):  # the camera looks along its z; its x is level, to the right
    x, y, z = (q - p for p, q in zip(v, u))
    a, b = math.atan2(y, x) / 2 - math.pi / 4, math.atan2(z, math.hypot(x, y)) / 2 - math.pi / 4
    turn = [math.cos(a) * math.sin(b), math.sin(a) * math.sin(b), math.sin(a) * math.cos(b), math.cos(a) * math.cos(b)]
    return {"translation": centre(v), "rotation": turn}
def closest_look(start):  # breadth first: what is seen from the first place that sees something, and the way there
    own, near, came, queue = *(collections.defaultdict(list) for _ in range(2)), {start: None}, collections.deque([start])
    for f in sorted(f for f in frontier if len(tried[f]) < LOOKS): own[tuple(c >> 3 for c in f)].append((f, unknown(f)[0]))
    for brick, d in itertools.product(own, around(SIGHT // 8 + 1)): near[add(brick, d)] += own[brick]
    while queue:
        v = queue.popleft()
        for f, u in near.get(tuple(c >> 3 for c in v), ()):
            if math.dist(v, f) <= SIGHT and v not in tried[f] and all(known.get(w) == "." for w in line(v, u, 2) if w != u):
                way = [v]
                while came[way[-1]]: way.append(came[way[-1]])
                return f, way[::-1]
        for w in beside(v):
            if w not in came and (has_room(w) or v == start and known.get(w) == "."):
                came[w] = v; queue.append(w)
def decide(place):
    global last
    last = closest_look(tuple(math.floor(c / res) for c in place))
    if not last:
        left = dict.fromkeys("unreachable no_return too_small open map_edge no_room volume_edge invisible unresolved".split(), 0)
        for f in frontier: left["unresolved" if len(tried[f]) >= LOOKS else "invisible"] += 1
        say(publish="EXPLORATION_REPORT", value=dict(explorer="closest_look.py", policy="own", settings=f"sight {SIGHT} voxels", plans=plans,
            complete=True, reason="nothing unknown is seen from anywhere", frontiers_left=left, counters=[], cpu_secs=[]))
        return "Done"
    (target, way), points = last, [place]
    corner, last, sides = way[0], (target, way[-1]), unknown(target)
    for here, there in zip(way, way[1:]):  # straight on as long as there is room
        if not all(map(has_room, line(corner, there, 4))): corner = here; points.append(centre(here))
    points.append(centre(way[-1]))
    return {"Go": dict(points=points, target=voxel(target), unknown=list(map(voxel, sides)), looks=[looking(way[-1], u) for u in sides])}

for said in map(json.loads, sys.stdin):
    value = said.get("value")
    if "hello" in said:  # the volume to explore, and the robot's radius, as the mission says them
        told = lambda name, usual: [float(part.split()[0]) for part in said["hello"]["parameters"].get(name, usual).split(";")]
        mid, dim, [radius] = told("Mid", "0;0;0"), told("Dim", "inf;inf;inf"), told("Radius", "0.1")
        for variable in "MAP_UPDATE", "MAP_PART", "PLAN_REQUEST": say(register=variable)
    if "hello" in said or "lost" in said:  # whoever comes late asks for the whole map, which comes in parts
        whole, parts, _ = False, 0, say(publish="MAP_REQUEST", value=1)
    elif said.get("mail") == "PLAN_REQUEST": request = value
    elif said.get("mail") in ("MAP_UPDATE", "MAP_PART"):
        res, revision, total = value["resolution"], value["revision"], value.get("total")
        for one in value["bricks"]: take(one["brick"], one["cells"])
        parts += len(value["bricks"]) if total else 0
        whole = whole or (parts >= total if total else value["since"] == 0)
    if request and whole and revision >= request["revision"]:
        if last and request["outcome"] != "Resolved": tried[last[0]].add(last[1])
        plans, began, decision = plans + 1, time.process_time(), decide(request["pose"]["translation"])
        motion = dict(name="own", scan_spacing_m=0.5, early_stop=True, look_at_target=True, clearance_m=radius)
        plan = dict(request=request["id"], revision=revision, decision=decision, motion=motion, cpu_secs=time.process_time() - began)
        request = say(publish="PLAN", value=plan)  # None: it is answered
