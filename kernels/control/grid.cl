/*---
title: A control and a majorant of the residual for each cell of a regular grid
uses: [walk/grid, control/cell_by_cell]
---*/
