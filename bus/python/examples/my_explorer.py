#!/usr/bin/env python3
"""The explorer of docs/strategy.md over shared memory: where to look is closest_look.py's, what is heard and said is here.
elk launch apartment --set Explorer.exec=bus/python/examples/my_explorer.py; in a suite pipe="…/my_explorer.py" has it told in lines."""
import pathlib, sys, time
import elk

sys.path.append(str(pathlib.Path(__file__).resolve().parents[2] / "pipe/examples"))
import closest_look as look

class Explorer(elk.App):
    request, whole, parts, lost = None, False, 0, -1

    def told(self, name, usual):
        return [float(part.split()[0]) for part in self.parameter(name, usual).split(";")]

    def on_start_up(self):
        look.mid, look.dim, [look.radius] = self.told("Mid", "0;0;0"), self.told("Dim", "inf;inf;inf"), self.told("Radius", "0.1")
        look.say = lambda publish, value: self.notify(publish, value)
        for variable in "MAP_UPDATE", "MAP_PART", "PLAN_REQUEST":
            self.register(variable)

    def on_new_mail(self, message):
        if self.dropped() > self.lost:  # whoever comes late asks for the whole map, which comes in parts
            self.lost, self.whole, self.parts = self.dropped(), False, 0
            self.notify("MAP_REQUEST", 1)
        if message.is_name("PLAN_REQUEST"):
            self.request = message.value()
        else:
            self.take(**message.value())
        if self.request and self.whole and self.revision >= self.request["revision"]:
            self.plan(**self.request)
            self.request = None

    def take(self, resolution, revision, bricks, since=None, total=None, **_):
        look.res, self.revision = resolution, revision
        for one in bricks:
            look.take(one["brick"], one["cells"])
        self.parts += len(bricks) if total else 0
        self.whole = self.whole or (self.parts >= total if total else since == 0)

    def plan(self, id, outcome, pose, **_):
        if look.last and outcome != "Resolved":
            look.tried[look.last[0]].add(look.last[1])
        look.plans += 1
        decision = look.decide(pose["translation"])
        motion = {"name": "own", "scan_spacing_m": 0.5, "early_stop": True, "look_at_target": True, "clearance_m": look.radius}
        self.notify("PLAN", {"request": id, "revision": self.revision, "decision": decision, "motion": motion, "cpu_secs": time.process_time()})

Explorer().run()
