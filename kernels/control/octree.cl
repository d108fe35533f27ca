/*---
title: A control and a majorant of the residual for each leaf of an octree
uses: [walk/octree, control/cell_by_cell]
---*/
