"""The paper's figures, each as a picture and as the numbers behind it.

Each function writes figNN.png and figNN.json into a folder and returns what the JSON
holds; "paper" in it is the paper's claim in our words. matplotlib and OpenGL load only
when a figure is drawn.
"""

from gaitchain.figures.chain import figure_6, figure_7
from gaitchain.figures.footing import figure_11
from gaitchain.figures.joints import figure_8
from gaitchain.figures.regret import regret_table
from gaitchain.figures.snapshots import figure_9
from gaitchain.figures.sticks import figure_10
from gaitchain.figures.walk import plot_walk

__all__ = [
    "figure_6",
    "figure_7",
    "figure_8",
    "figure_9",
    "figure_10",
    "figure_11",
    "plot_walk",
    "regret_table",
]
