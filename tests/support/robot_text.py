"""Robots' files, written for a test."""


def write(folder, text, name="robot.xml"):
    """Write a file in a folder that may not be there yet."""
    path = folder / name
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text(text, "utf-8")
    return path
