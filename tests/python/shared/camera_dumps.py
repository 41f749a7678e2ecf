# SPDX-License-Identifier: Apache-2.0
"""Texts of rs-enumerate-devices -c for a D435."""

ENUMERATED = """\
Device info:
    Name                          : 	Intel RealSense D435

Intrinsic Parameters:

 Intrinsic of "Depth" / 64x48 / {Z16}
  Width:      	64
  Height:     	48
  PPX:        	32.1
  PPY:        	24.2
  Fx:         	43.0
  Fy:         	43.0
  Distortion: 	Brown Conrady
  Coeffs:     	0  	0  	0  	0  	0
  FOV (deg):  	73.3 x 58.3

 Intrinsic of "Infrared 1" / 64x48 / {Y8}
  Width:      	64
  Height:     	48
  PPX:        	32.1
  PPY:        	24.2
  Fx:         	43.0
  Fy:         	43.5
  Distortion: 	Brown Conrady
  Coeffs:     	0  	0  	0  	0  	0
  FOV (deg):  	73.3 x 58.3

 Intrinsic of "Infrared 2" / 64x48 / {Y8}
  Width:      	64
  Height:     	48
  PPX:        	32.1
  PPY:        	24.2
  Fx:         	43.0
  Fy:         	43.5
  Distortion: 	Brown Conrady
  Coeffs:     	0  	0  	0  	0  	0
  FOV (deg):  	73.3 x 58.3

Extrinsic Parameters:
 Extrinsic from "Infrared 1"	  To	  "Infrared 2" :
 Rotation Matrix:
   1                0                0
   0                1                0
   0                0                1

 Translation Vector: -0.0499585680663586  0  0

 Extrinsic from "Infrared 2"	  To	  "Infrared 1" :
 Rotation Matrix:
   1                0                0
   0                1                0
   0                0                1

 Translation Vector: 0.0499585680663586  0  0
"""
