"""Transport of discrete movements to other starts and goals, and their ends."""
