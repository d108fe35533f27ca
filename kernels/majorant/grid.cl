/*---
title: A majorant for each cell of a regular grid
uses: [walk/grid, majorant/cell_by_cell]
---*/
