"""Figures: those of the paper, and those that the commands draw.

Fig. 6 and 7 are in `chain`, 8 in `joints`, 9 in `snapshots`, 10 in `sticks` and 11 in
`footing`; each function writes figNN.png and, with the numbers behind the picture,
figNN.json into a folder and returns what the JSON holds; "paper" in it is the paper's
claim in our words. The commands' own are `walk`, `replay`, `timeline`, `robustness` and
`robot`.
matplotlib and OpenGL load only when a figure is drawn.
"""
