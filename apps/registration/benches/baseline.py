"""Registration of two clouds by small_gicp, on one thread.

Reads from the folder argv[1] `source.xyz` and `target.xyz`, little-endian 32-bit floats, three a point. Prints for each kind a line `kind milliseconds
m11 … m44`: the least CPU time of argv[2] turns for the whole way from points to the pose, source → target, row by row.
"""
import sys
import time

import numpy as np
import small_gicp

folder, turns = sys.argv[1], int(sys.argv[2])
source, target = (np.fromfile(f"{folder}/{name}.xyz", np.float32).reshape(-1, 3).astype(np.float64) for name in ("source", "target"))
for kind in ("ICP", "PLANE_ICP", "GICP", "VGICP"):
    times = []
    for _ in range(turns):
        start = time.thread_time()
        result = small_gicp.align(target, source, np.eye(4), registration_type=kind, num_threads=1)
        times.append(time.thread_time() - start)
    print(kind, min(times) * 1e3, *result.T_target_source.ravel(), flush=True)
