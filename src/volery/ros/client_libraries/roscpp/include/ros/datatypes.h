#pragma once
#include "ros/names.h"
