# SPDX-License-Identifier: Apache-2.0
"""Converts recordings of other programs to captures (capture format, version 1).

    realsense_text     output of `rs-enumerate-devices -c`: intrinsics and extrinsics
    calibration        calibrations of both cameras from any program: ROS, Kalibr, OpenCV, Middlebury
    realsense_folder   folders of PNG files of a librealsense recording
    bag                librealsense's .bag, bags of ROS 1 and ROS 2 (with rosbags)
    color_depth        TUM's, Open3D's and BOP's folders of colour and depth
    frames             camera poses as a TUM text file, repeats of views, and frames as captures

Every failure of the input is a ValueError of one line: the file, the key and the value."""
