# Finds the inner corners of a chessboard: asked "picture columns rows", answers {"corners": [[x, y], ...] or null}.
import json, sys
try:
    import cv2
except ImportError:
    print(json.dumps({"missing": "python3 has no OpenCV"}), flush=True)
    sys.exit()
print(json.dumps({"version": cv2.__version__}), flush=True)
for line in sys.stdin:
    picture, columns, rows = map(int, line.split())
    image = cv2.imread(sys.argv[1 + picture], cv2.IMREAD_GRAYSCALE)
    found, corners = cv2.findChessboardCorners(image, (columns, rows)) if image is not None else (False, None)
    if found:
        end = (cv2.TERM_CRITERIA_EPS + cv2.TERM_CRITERIA_MAX_ITER, 100, 1e-4)
        corners = cv2.cornerSubPix(image, corners, (5, 5), (-1, -1), end).reshape(-1, 2).tolist()
    print(json.dumps({"corners": corners if found else None}), flush=True)
