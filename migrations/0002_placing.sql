-- Places found by the server from views, with what a place by hand does not have.

-- Turn about the outward normal, and of the normal downwards (pi/2 under a ceiling); NULL is 0.
ALTER TABLE landmarks ADD COLUMN roll_rad REAL;
ALTER TABLE landmarks ADD COLUMN tilt_rad REAL;
-- 36 little-endian f64, row by row, over (x, y, theta, z, width, height): exact, and read as a whole. NULL: the place was
-- given by hand, and is as sure as a tape.
ALTER TABLE landmarks ADD COLUMN place_covariance BLOB CHECK (length(place_covariance) = 288);
-- The size was found with the place and may be found anew; a size by hand stays.
ALTER TABLE landmarks ADD COLUMN size_from_views INTEGER CHECK (size_from_views IN (0, 1));
-- JSON: intrinsics, where the robot stood and where the camera sat when the picture was taken; checked when it came.
ALTER TABLE views ADD COLUMN capture TEXT CHECK (length(capture) <= 8192);
