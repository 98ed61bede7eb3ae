# Poses of a rectangle by OpenCV: asked [[[x, y] * 4], ...], answers [[[rvec, tvec], ...] best first, ...] and its time.
import json, sys, time
try:
    import cv2
    import numpy as np
except ImportError:
    print(json.dumps({"missing": "python3 has no OpenCV"}), flush=True)
    sys.exit()
cv2.setNumThreads(1)
print(json.dumps({"version": cv2.__version__}), flush=True)
K = np.array([[700.0, 0, 320], [0, 700, 240], [0, 0, 1]])
W, H = 0.6, 0.84
# In the plane z = 0: x right, y up, as IPPE wants it.
P = np.array([[-W / 2, H / 2, 0], [W / 2, H / 2, 0], [W / 2, -H / 2, 0], [-W / 2, -H / 2, 0]])
for line in sys.stdin:
    answers, spent = [], 0.0
    for corners in json.loads(line):
        corners = np.array(corners).reshape(-1, 1, 2)
        start = time.perf_counter()
        n, rs, ts, errors = cv2.solvePnPGeneric(P, corners, K, None, flags=cv2.SOLVEPNP_IPPE)
        best = []
        for r, t in zip(rs, ts):
            r, t = cv2.solvePnPRefineLM(P, corners, K, None, r.copy(), t.copy())
            seen, _ = cv2.projectPoints(P, r, t, K, None)
            best.append((float(((seen - corners) ** 2).sum()), r.ravel().tolist(), t.ravel().tolist()))
        spent += time.perf_counter() - start
        best.sort()
        answers.append([best[0][1], best[0][2]])
    print(json.dumps({"poses": answers, "us": 1e6 * spent / max(1, len(answers))}), flush=True)
