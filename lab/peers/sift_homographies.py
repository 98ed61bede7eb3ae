"""OpenCV's SIFT with RANSAC, landmark by landmark, one thread: their frontal pictures in; for each frame asked for by
its path, the landmarks with enough inliers, each with the border that its homography gives, and processor time out."""
import json
import sys
import time

try:
    import cv2
    import numpy as np
except ImportError as error:
    print(json.dumps({"missing": str(error)}), flush=True)
    sys.exit(0)

MIN_INLIERS, RATIO, REPROJECTION_PX = 10, 0.8, 5.0
cv2.setNumThreads(1)
cv2.setRNGSeed(1)
sift, matcher = cv2.SIFT_create(), cv2.BFMatcher(cv2.NORM_L2)


def described(path):
    image = cv2.imread(path, cv2.IMREAD_GRAYSCALE)
    points, descriptors = sift.detectAndCompute(image, None)
    return image.shape, np.float32([point.pt for point in points]), descriptors


def border(landmark, frame):
    """Inliers and projected border of a landmark in a frame; none where the homography does not hold."""
    ((height, width), known, of_landmark), (_, seen, of_frame) = landmark, frame
    if of_landmark is None or of_frame is None or len(known) < MIN_INLIERS or len(seen) < 2:
        return None
    pairs = [pair for pair in matcher.knnMatch(of_landmark, of_frame, k=2) if len(pair) == 2]
    good = [a for a, b in pairs if a.distance < RATIO * b.distance]
    if len(good) < MIN_INLIERS:
        return None
    homography, inliers = cv2.findHomography(
        known[[m.queryIdx for m in good]], seen[[m.trainIdx for m in good]], cv2.RANSAC, REPROJECTION_PX
    )
    if homography is None or int(inliers.sum()) < MIN_INLIERS:
        return None
    corners = np.float32([[0, 0], [width - 1, 0], [width - 1, height - 1], [0, height - 1]])
    projected = cv2.perspectiveTransform(corners[:, None], homography)[:, 0].tolist()
    return {"inliers": int(inliers.sum()), "corners": projected}


landmarks = [described(path) for path in sys.argv[1:]]
print(json.dumps({"version": cv2.__version__}), flush=True)
for line in sys.stdin:
    start = time.process_time()
    frame = described(line.strip())
    found = [(number, border(landmark, frame)) for number, landmark in enumerate(landmarks)]
    named = [{"number": number, **there} for number, there in found if there is not None]
    print(json.dumps({"ms": 1e3 * (time.process_time() - start), "named": named}), flush=True)
