# SPDX-License-Identifier: Apache-2.0
"""Converts recordings of other programs to captures (capture format, version 1).

    realsense_text     output of `rs-enumerate-devices -c`: intrinsics and extrinsics
    calibration        a calibration of both cameras, whichever program wrote it; Middlebury's and ETH3D's calib.txt
    calibration_yaml   ROS' camera_info, Kalibr's camera chain, OpenCV's matrices, by PyYAML, if installed
    realsense_folder   a folder of a librealsense recording's PNG files
    bag                librealsense's .bag, bags of ROS 1 and ROS 2, by the package rosbags, if installed
    color_depth_bag    the same of depth and colour alone
    trajectory         camera poses as a TUM text file

Every failure of the input is a ValueError of one line: the file, the key and the value.
"""
