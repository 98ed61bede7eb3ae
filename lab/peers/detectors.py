"""OpenCV's detectors on given pictures, one thread: a picture's number in, processor times out, line by line."""
import json
import sys
import time

try:
    import cv2
except ImportError as error:
    print(json.dumps({"missing": str(error)}), flush=True)
    sys.exit(0)

cv2.setNumThreads(1)
images = [cv2.imread(path, cv2.IMREAD_GRAYSCALE) for path in sys.argv[1:]]

operations = {"Canny": lambda image: cv2.Canny(image, 50, 150)}
lsd = cv2.createLineSegmentDetector()
operations["LSD"] = lsd.detect
if hasattr(cv2, "ximgproc"):
    drawing = cv2.ximgproc.createEdgeDrawing()

    def ed_lines(image):
        drawing.detectEdges(image)
        drawing.detectLines()

    operations["EDLines"] = ed_lines
if hasattr(cv2, "aruco") and hasattr(cv2.aruco, "ArucoDetector"):
    dictionary = cv2.aruco.getPredefinedDictionary(cv2.aruco.DICT_4X4_50)
    operations["ArUco"] = cv2.aruco.ArucoDetector(dictionary).detectMarkers

print(json.dumps({"version": cv2.__version__}), flush=True)
for line in sys.stdin:
    image, times = images[int(line)], {}
    for name, operation in operations.items():
        operation(image)
        # Of the whole program: work that an operation gives to other threads counts as well.
        start = time.process_time()
        operation(image)
        times[name] = 1e3 * (time.process_time() - start)
    print(json.dumps(times), flush=True)
