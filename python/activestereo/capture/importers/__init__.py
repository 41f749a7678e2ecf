# SPDX-License-Identifier: Apache-2.0
"""Converts recordings of other programs to captures (capture format, version 1).

    realsense_text     output of `rs-enumerate-devices -c`: intrinsics and extrinsics
    calibration        calibrations of both cameras from any program; Middlebury's and ETH3D's calib.txt
    calibration_yaml   ROS' camera_info, Kalibr's camera chain, OpenCV's matrices (with PyYAML)
    realsense_folder   folders of PNG files of a librealsense recording
    bag                librealsense's .bag, bags of ROS 1 and ROS 2 (with rosbags)
    color_depth_folders TUM's, Open3D's and BOP's folders of colour and depth
    trajectory         camera poses as a TUM text file

Every failure of the input is a ValueError of one line: the file, the key and the value."""
