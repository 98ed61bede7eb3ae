"""OpenCV's SIFT with one index over all landmarks, votes and RANSAC, one thread: the number of landmarks, their
pictures and the frames in; for each frame asked for by its number, processor time and accepted landmarks out."""
import json
import sys
import time

try:
    import cv2
    import numpy as np
except ImportError as error:
    print(json.dumps({"missing": str(error)}), flush=True)
    sys.exit(0)

MIN_INLIERS, SHORT_LIST, RATIO, REPROJECTION_PX = 12, 5, 0.8, 5.0
cv2.setNumThreads(1)
cv2.setRNGSeed(1)
count, files = int(sys.argv[1]), sys.argv[2:]
taught = cv2.SIFT_create(nfeatures=280)
points, descriptors, owners = [], [], []
for number, path in enumerate(files[:count]):
    found, described = taught.detectAndCompute(cv2.imread(path, cv2.IMREAD_GRAYSCALE), None)
    points.append(np.float32([point.pt for point in found]))
    if described is not None:
        descriptors.append(described)
        owners.append(np.stack([np.full(len(found), number), np.arange(len(found))], axis=1))
index = cv2.FlannBasedMatcher({"algorithm": 1, "trees": 4}, {"checks": 32})
owners = np.concatenate(owners)
index.add([np.concatenate(descriptors)])
index.train()
frames = [cv2.imread(path, cv2.IMREAD_GRAYSCALE) for path in files[count:]]
asked = cv2.SIFT_create(nfeatures=1000)


def recognise(image):
    found, described = asked.detectAndCompute(image, None)
    votes = {}
    for pair in index.knnMatch(described, k=2) if described is not None else []:
        if len(pair) == 2 and pair[0].distance < RATIO * pair[1].distance:
            number, point = owners[pair[0].trainIdx]
            votes.setdefault(int(number), []).append((found[pair[0].queryIdx].pt, points[number][point]))
    accepted = []
    for number in sorted(votes, key=lambda n: (-len(votes[n]), n))[:SHORT_LIST]:
        if len(votes[number]) < MIN_INLIERS:
            break
        seen = np.float32([a for a, _ in votes[number]])
        known = np.float32([b for _, b in votes[number]])
        _, inliers = cv2.findHomography(known, seen, cv2.RANSAC, REPROJECTION_PX)
        if inliers is not None and int(inliers.sum()) >= MIN_INLIERS:
            accepted.append(number)
    return accepted


print(json.dumps({"version": cv2.__version__, "descriptors": len(owners)}), flush=True)
if frames:
    recognise(frames[0])
for line in sys.stdin:
    # Of the whole program: work that is given to other threads counts as well.
    start = time.process_time()
    accepted = recognise(frames[int(line)])
    print(json.dumps({"ms": 1e3 * (time.process_time() - start), "accepted": accepted}), flush=True)
