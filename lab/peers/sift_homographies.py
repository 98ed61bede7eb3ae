"""OpenCV's SIFT with votes and RANSAC, one thread: frontal pictures of the landmarks in; for each frame asked for by
its path, the landmarks with enough inliers, each with the border of its homography, and processor time out."""
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
    return image.shape, np.float32([point.pt for point in points]).reshape(-1, 2), descriptors


def border(number, known, seen):
    """The border of a landmark by a homography of matched points; none where it does not hold or is folded over."""
    if len(known) < MIN_INLIERS:
        return None
    homography, inliers = cv2.findHomography(np.float32(known), np.float32(seen), cv2.RANSAC, REPROJECTION_PX)
    if homography is None or int(inliers.sum()) < MIN_INLIERS:
        return None
    height, width = landmarks[number][0]
    corners = np.float32([[0, 0], [width - 1, 0], [width - 1, height - 1], [0, height - 1]])
    projected = cv2.perspectiveTransform(corners[:, None], homography)
    if not cv2.isContourConvex(projected) or not np.isfinite(projected).all():
        return None
    return {"number": number, "inliers": int(inliers.sum()), "corners": projected[:, 0].tolist()}


def named(frame):
    """Matches against all landmarks at once: the second nearest may be of another landmark."""
    _, points, descriptors = frame
    votes = {}
    for pair in matcher.knnMatch(descriptors, index, k=2) if descriptors is not None else []:
        if len(pair) == 2 and pair[0].distance < RATIO * pair[1].distance:
            number, point = owners[pair[0].trainIdx]
            known, seen = votes.setdefault(int(number), ([], []))
            known.append(landmarks[number][1][point])
            seen.append(points[pair[0].queryIdx])
    found = [border(number, *votes[number]) for number in sorted(votes)]
    return [there for there in found if there is not None]


landmarks = [described(path) for path in sys.argv[1:]]
owners = [(number, i) for number, landmark in enumerate(landmarks) for i in range(len(landmark[1]))]
index = np.concatenate([landmark[2] for landmark in landmarks if landmark[2] is not None])
print(json.dumps({"version": cv2.__version__}), flush=True)
for line in sys.stdin:
    start = time.process_time()
    answer = named(described(line.strip()))
    print(json.dumps({"ms": 1e3 * (time.process_time() - start), "named": answer}), flush=True)
