#!/usr/bin/env python3
"""An explorer: to the closest place that sees something unknown."""
# elk launch apartment --set Explorer.exec=bus/python/examples/my_explorer.py
# has it on shared memory; where a mission or a suite says pipe="…/my_explorer.py" it is told all in lines.
import collections, itertools, math, time
import elk

SIGHT, LOOKS = 15, 4  # voxels from which something is looked at; looks in vain before it is given up
FACES = [(1, 0, 0), (-1, 0, 0), (0, 1, 0), (0, -1, 0), (0, 0, 1), (0, 0, -1)]

def add(v, d): return v[0] + d[0], v[1] + d[1], v[2] + d[2]
def beside(v): return [add(v, d) for d in FACES]
def around(n): return itertools.product(range(-n, n + 1), repeat=3)

def line(a, b, fine):  # the voxels from the centre of one to that of another, which is left out
    n = fine * max(abs(q - p) for p, q in zip(a, b))
    return (v for k in range(n) if (v := tuple(math.floor(p + 0.5 + (q - p) * k / n) for p, q in zip(a, b))) != b)

def facing(x, y, z):  # the rotation of a camera that looks there: along its z; its x is level, to the right
    a, b = math.atan2(y, x) / 2 - math.pi / 4, math.atan2(z, math.hypot(x, y)) / 2 - math.pi / 4
    return [math.cos(a) * math.sin(b), math.sin(a) * math.sin(b), math.sin(a) * math.cos(b), math.cos(a) * math.cos(b)]

class Explorer(elk.App):
    known, walls = {}, collections.Counter()  # by voxel: "." or "#"; how many occupied ones are too near for the robot
    frontier, tried = {}, collections.defaultdict(set)  # of a free voxel, an unknown one beside it; from where it was looked at in vain
    request, missing, plans, last = None, math.inf, 0, None

    def on_start_up(self):  # the volume to explore, and the robot's radius (m), as the mission says them
        told = lambda name, usual: [float(part.split()[0]) for part in self.parameter(name, usual).split(";")]
        self.mid, self.dim, [self.radius] = told("Mid", "0;0;0"), told("Dim", "inf;inf;inf"), told("Radius", "0.1")
        for variable in "MAP_UPDATE", "MAP_PART", "PLAN_REQUEST": self.register(variable, lossless=True)
        self.notify("MAP_REQUEST", 1)  # whoever comes late is told the whole map, in parts

    def on_new_mail(self, message):
        if message.is_name("PLAN_REQUEST"): self.request = message.value()
        else: self.take(**message.value())
        if self.request and self.missing <= 0 and self.revision >= self.request["revision"]: self.request = self.answer(**self.request)

    def take(self, resolution, revision, bricks, since=None, total=None, **_):
        self.res, self.revision = resolution, revision
        for one in bricks:
            for (z, y, x), cell in zip(itertools.product(range(8), repeat=3), one["cells"]):
                v = add([8 * c for c in one["brick"]], (x, y, z))
                if cell != self.known.get(v, "?"): self.learn(v, self.known.get(v), cell)
        self.missing = 0 if since == 0 else min(self.missing, total) - len(bricks) if total else self.missing  # of the whole map

    def learn(self, v, was, cell):
        for d in around(math.ceil(self.radius / self.res - 1e-9)) if "#" in (was, cell) else ():
            self.walls[add(v, d)] += 1 if cell == "#" else -1
        self.known[v] = cell
        self.frontier.update(dict.fromkeys([v, *beside(v)]))  # perhaps: the next plan looks

    def centre(self, v): return [(c + 0.5) * self.res for c in v]
    def inside(self, v): return all(abs(c - m) <= d / 2 for c, m, d in zip(self.centre(v), self.mid, self.dim))
    def unknown(self, v): return [w for w in beside(v) if w not in self.known and self.inside(w)]
    def has_room(self, v): return self.known.get(v) == "." and not self.walls[v]

    def closest_look(self, start):  # breadth first: what is seen from the first place that sees something, and the way there
        near, ways, reached = collections.defaultdict(list), collections.deque([[start]]), {start}
        self.frontier = {f: sides[0] for f in self.frontier if self.known.get(f) == "." and (sides := self.unknown(f))}
        for f, d in itertools.product(sorted(f for f in self.frontier if len(self.tried[f]) < LOOKS), around(1)):
            near[add([c // SIGHT for c in f], d)].append((f, self.frontier[f]))
        while ways:
            *_, v = way = ways.popleft()
            for f, u in near.get(tuple(c // SIGHT for c in v), ()):
                if v not in self.tried[f] and math.dist(v, f) <= SIGHT and all(self.known.get(w) == "." for w in line(v, u, 2)):
                    return f, way
            for w in beside(v):
                if w not in reached and (self.has_room(w) or v == start and self.known.get(w) == "."):
                    reached.add(w); ways.append([*way, w])
        return None, [start]

    def answer(self, id, outcome, pose, **_):
        began = time.process_time()
        if self.last and outcome != "Resolved": self.tried[self.last[0]].add(self.last[1])
        target, way = self.closest_look(tuple(math.floor(c / self.res) for c in pose["translation"]))
        self.last, self.plans = target and (target, way[-1]), self.plans + 1
        goal = self.go(pose["translation"], way, target) if target else self.done()
        motion = {"name": "own", "scan_spacing_m": 0.5, "early_stop": True, "look_at_target": True, "clearance_m": self.radius}
        self.notify("PLAN", dict(request=id, revision=self.revision, decision=goal, motion=motion, cpu_secs=time.process_time() - began))

    def go(self, place, way, target):
        points, corner, sides = [place], way[0], self.unknown(target)
        for here, there in zip(way, way[1:]):  # straight on as long as there is room
            if not all(map(self.has_room, line(corner, there, 4))): corner = here; points.append(self.centre(here))
        looks = [{"translation": self.centre(way[-1]), "rotation": facing(*(q - p for p, q in zip(way[-1], u)))} for u in sides]
        target, *unknown = (dict(zip("xyz", v)) for v in [target, *sides])
        return {"Go": {"points": [*points, self.centre(way[-1])], "target": target, "unknown": unknown, "looks": looks}}

    def done(self):
        left = dict.fromkeys("unreachable no_return too_small open map_edge no_room volume_edge invisible unresolved".split(), 0)
        for f in self.frontier: left["unresolved" if len(self.tried[f]) >= LOOKS else "invisible"] += 1
        self.notify("EXPLORATION_REPORT", dict(explorer="my_explorer.py", policy="own", settings=f"sight {SIGHT} voxels", plans=self.plans,
            complete=True, reason="nothing unknown is seen from anywhere", frontiers_left=left, counters=[], cpu_secs=[]))
        return "Done"

Explorer().run()
