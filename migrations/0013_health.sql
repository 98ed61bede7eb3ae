-- How far a landmark is trusted is called its health.
ALTER TABLE landmarks RENAME COLUMN standing TO health;
