#!/usr/bin/env python3
"""An explorer over shared memory: to the closest place that sees something unknown.
elk launch apartment --set Explorer.exec=bus/python/examples/my_explorer.py"""
import collections, itertools, math, time
import elk

FACES = [(1, 0, 0), (-1, 0, 0), (0, 1, 0), (0, -1, 0), (0, 0, 1), (0, 0, -1)]
SIGHT, LOOKS = 15, 4  # voxels from which something is looked at; looks in vain before it is given up
# By voxel: "." or "#", and how many occupied ones are too near; where the known ends; from where that was looked at.
known, walls, frontier, tried = {}, collections.Counter(), set(), collections.defaultdict(set)

def add(v, d): return v[0] + d[0], v[1] + d[1], v[2] + d[2]
def around(n): return itertools.product(range(-n, n + 1), repeat=3)
def beside(v): return [add(v, d) for d in FACES]
def centre(v): return [(c + 0.5) * res for c in v]
def voxel(v): return dict(zip("xyz", v))
def unknown(v): return [w for w in beside(v) if w not in known and all(abs(c - m) <= d / 2 for c, m, d in zip(centre(w), mid, dim))]
def has_room(v): return known.get(v) == "." and not walls[v]
def line(a, b):  # the voxels between the centres of two
    n = 2 * max(abs(q - p) for p, q in zip(a, b)) or 1
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
    return dict(translation=centre(v), rotation=[math.cos(a) * math.sin(b), math.sin(a) * math.sin(b),
        math.sin(a) * math.cos(b), math.cos(a) * math.cos(b)])
def closest_look(start):  # breadth first: what is seen from the first place that sees something, and the way there
    own, near, came, queue = *(collections.defaultdict(list) for _ in range(2)), {start: None}, collections.deque([start])
    for f in sorted(f for f in frontier if len(tried[f]) < LOOKS): own[tuple(c >> 3 for c in f)].append((f, unknown(f)[0]))
    for brick, d in itertools.product(own, around(SIGHT // 8 + 1)): near[add(brick, d)] += own[brick]
    while queue:
        v = queue.popleft()
        for f, u in near.get(tuple(c >> 3 for c in v), ()):
            if math.dist(v, f) <= SIGHT and v not in tried[f] and all(known.get(w) == "." for w in line(v, u) if w != u):
                way = [v]
                while came[way[-1]]: way.append(came[way[-1]])
                return f, way[::-1]
        for w in beside(v):
            if w not in came and (has_room(w) or v == start and known.get(w) == "."):
                came[w] = v; queue.append(w)

class Explorer(elk.App):
    plans, last, request, whole, parts, lost = 0, None, None, False, 0, -1
    def told(self, name, usual): return [float(part.split()[0]) for part in self.parameter(name, usual).split(";")]
    def on_start_up(self):
        for variable in "MAP_UPDATE", "MAP_PART", "PLAN_REQUEST": self.register(variable)
    def on_new_mail(self, message):
        if self.dropped() > self.lost:  # whoever comes late asks for the whole map, which comes in parts
            self.lost, self.whole, self.parts = self.dropped(), False, 0
            self.notify("MAP_REQUEST", 1)
        value = message.value()
        if message.is_name("PLAN_REQUEST"): self.request = value
        else:
            self.revision, total = value["revision"], value.get("total")
            for one in value["bricks"]: take(one["brick"], one["cells"])
            self.parts += len(value["bricks"]) if total else 0
            self.whole = self.whole or (self.parts >= total if total else value["since"] == 0)
        if self.request and self.whole and self.revision >= self.request["revision"]: self.plan(self.request)
    def plan(self, request):
        if self.last and request["outcome"] != "Resolved": tried[self.last[0]].add(self.last[1])
        self.plans, self.request, decision = self.plans + 1, None, self.decide(request["pose"]["translation"])
        self.notify("PLAN", dict(request=request["id"], revision=self.revision, decision=decision, cpu_secs=time.process_time(),
            motion=dict(name="own", scan_spacing_m=0.5, early_stop=True, look_at_target=True, clearance_m=radius)))
    def decide(self, place):
        if found := closest_look(tuple(math.floor(c / res) for c in place)):
            (target, way), sides, self.last = found, unknown(found[0]), (found[0], found[1][-1])
            return {"Go": dict(points=[place] + [centre(v) for v in way], target=voxel(target), unknown=[voxel(u) for u in sides],
                looks=[looking(way[-1], u) for u in sides])}
        left = dict.fromkeys("unreachable no_return too_small open map_edge no_room volume_edge invisible unresolved".split(), 0)
        left.update(collections.Counter("unresolved" if len(tried[f]) >= LOOKS else "invisible" for f in frontier))
        return self.notify("EXPLORATION_REPORT", dict(explorer="my_explorer.py", policy="own", settings=f"sight {SIGHT} voxels", plans=self.plans,
            complete=True, reason="nothing unknown is seen from anywhere", frontiers_left=left, counters=[], cpu_secs=[])) and "Done"

app = Explorer()
[res], mid, dim, [radius] = app.told("Res", "0.1"), app.told("Mid", "0;0;0"), app.told("Dim", "inf;inf;inf"), app.told("Radius", "0.1")
app.run()
