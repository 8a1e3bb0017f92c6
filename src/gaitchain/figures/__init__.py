"""Figures of the paper, and figures of the commands.

Fig. 6 and 7 are in `chain`, 8 in `joints`, 9 in `snapshots`, 10 in `sticks` and 11 in
`footing`. Each function writes figNN.png and figNN.json into a folder and returns the
content of the JSON: the numbers behind the picture, and as "paper" the paper's claim
in our words. The figures of the commands are in `walk`, `replay`, `timeline`,
`robustness` and `robot`. matplotlib and OpenGL load only when a figure is drawn.
"""
