"""Draft skeleton."""
import numpy as np
from crowd.motion.skeleton import Segment, Skeleton
from crowd_kernels.random import normal

def build_skeleton(H=1.75):
    S=Segment
    names=[];par=[];off=[];seg=[]
    def j(n,p,o,s): names.append(n);par.append(names.index(p) if p else -1);off.append(o);seg.append(int(s))
    j('pelvis',None,(0,.97,0),S.LEG)
    j('spine_1','pelvis',(0,.08,-.01),S.TORSO);j('spine_2','spine_1',(0,.1,0),S.TORSO);j('spine_3','spine_2',(0,.11,0),S.TORSO);j('spine_4','spine_3',(0,.11,0),S.TORSO)
    j('neck_1','spine_4',(0,.12,0),S.NECK_HEAD);j('neck_2','neck_1',(0,.06,.01),S.NECK_HEAD);j('head','neck_2',(0,.05,.01),S.NECK_HEAD)
    j('left_eye','head',(.032,.05,.085),S.NECK_HEAD);j('right_eye','head',(-.032,.05,.085),S.NECK_HEAD)
    for side,g in (('left',1),('right',-1)):
        j(f'{side}_clavicle','spine_4',(.02*g,.08,.0),S.SHOULDER);j(f'{side}_upper_arm',f'{side}_clavicle',(.165*g,-.02,0),S.SHOULDER)
        j(f'{side}_forearm',f'{side}_upper_arm',(0,-.326,0),S.ARM);j(f'{side}_hand',f'{side}_forearm',(0,-.256,0),S.ARM)
        for f,(z,l1,l2,l3) in dict(thumb=(.03,.046,.032,.022),index=(.025,.09,.04,.022),middle=(.005,.092,.045,.026),ring=(-.015,.088,.041,.026),little=(-.033,.08,.033,.018)).items():
            first=(0,-.03,.03) if f=='thumb' else (0,-l1,z)
            j(f'{side}_{f}_1',f'{side}_hand',first,S.HAND)
            d=(0,-.03,.02) if f=='thumb' else (0,-l2,0);j(f'{side}_{f}_2',f'{side}_{f}_1',d,S.HAND)
            d=(0,-.025,.01) if f=='thumb' else (0,-l3,0);j(f'{side}_{f}_3',f'{side}_{f}_2',d,S.HAND)
    for side,g in (('left',1),('right',-1)):
        j(f'{side}_thigh','pelvis',(.0875*g,-.042,0),S.PELVIS);j(f'{side}_shank',f'{side}_thigh',(0,-.429,0),S.LEG)
        j(f'{side}_foot',f'{side}_shank',(0,-.431,0),S.LEG);j(f'{side}_toe',f'{side}_foot',(0,-.043,.13),S.FOOT)
    off=np.array(off)*H/1.75
    n=len(names)
    return Skeleton(tuple(names),np.array(par,np.int32),off,np.array(seg,np.int32),np.full((n,3),-3.),np.full((n,3),3.),H)

def draw_segment_scale(skeleton,stature,seed):
    n=len(stature)
    s=np.repeat((stature/skeleton.stature)[:,None],8,1)
    for c in range(n):
        s[c,Segment.LEG]*=1+.02*np.clip(normal(seed,c,0,401),-2,2)
    s[:,Segment.FOOT]=s[:,Segment.LEG]; s[:,Segment.PELVIS]=s[:,Segment.LEG]
    return s.astype(np.float32)
