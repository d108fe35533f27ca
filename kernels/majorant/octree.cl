/*---
title: A majorant for each leaf of an octree
uses: [walk/octree, majorant/cell_by_cell]
---*/
